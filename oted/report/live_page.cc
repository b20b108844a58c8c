#include "oted/report/live_page.h"

#include <fmt/format.h>

#include <array>

#include "oted/report/html_text.h"
#include "oted/report/page_assets.h"

namespace oted {
namespace {

constexpr std::array kBarColours = {"--designed", "--nominal", "--low", "--muted"};

std::string Bar(const std::vector<std::pair<std::string, double>>& parts) {
  std::string bar, key;
  for (size_t i = 0; i < parts.size(); ++i) {
    const auto& [name, share] = parts[i];
    const char* colour = kBarColours[i % kBarColours.size()];
    bar += fmt::format("<div style=\"width:{:.3f}%;background:var({})\"></div>", 100 * share, colour);
    key += fmt::format("<span><b style=\"color:var({})\">&#9632;</b> {}</span> ", colour, Escape(name));
  }
  return fmt::format(
      "<div role=\"img\" aria-label=\"Progress\" style=\"display:flex;height:1.2rem;overflow:hidden;"
      "border-radius:.3rem;background:color-mix(in srgb, currentColor 12%, transparent)\">{}</div>\n<p>{}</p>\n",
      bar, key);
}

}  // namespace

std::string LivePage::Html() const {
  std::string page = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n<meta http-equiv=\"refresh\" content=\"{}\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
      "img-src data:\">\n<link rel=\"icon\" href=\"data:,\">\n<title>{}</title>\n<style>\n{}</style>\n</head>\n"
      "<body>\n<main>\n<header id=\"top\"><p class=\"eyebrow\">{}</p><h1>{}</h1>\n",
      refresh_s, Escape(title), PageStyle(), Escape(title), Escape(headline));
  page += Bar(parts);
  for (const std::string& paragraph : text) page += fmt::format("<p>{}</p>\n", Escape(paragraph));
  page += "</header>\n";
  for (const Table& table : tables) {
    if (table.rows.empty()) continue;
    HtmlTable html;
    for (const std::string& column : table.columns) html.Column(column, HtmlTable::Align::kText);
    for (const std::vector<std::string>& row : table.rows) {
      std::vector<std::string> cells;
      for (const std::string& cell : row) cells.push_back(Escape(cell));
      html.Row(std::move(cells));
    }
    page += fmt::format("<section><h2>{}</h2>\n{}</section>\n", Escape(table.title), html.Html());
  }
  return page + "</main>\n</body>\n</html>\n";
}

}  // namespace oted
