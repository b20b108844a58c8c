#include "oted/report/html_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/package_folders.h"
#include "oted/data/gzip.h"
#include "oted/report/json_values.h"
#include "oted/report/page_assets.h"
#include "oted/report/sections_agents.h"
#include "oted/report/sections_behavior.h"
#include "oted/report/sections_design.h"
#include "oted/report/sections_record.h"
#include "oted/report/sections_replay.h"
#include "oted/report/sections_result.h"
#include "oted/report/sections_selection.h"

namespace oted {
namespace {

using nlohmann::json;

// The browser itself refuses whatever would reach for the network.
constexpr std::string_view kPolicy =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:";

std::string Header(const json& report) {
  const json& summary = report.at("summary");
  const std::string verdict = TextAt(summary, "verdict");
  const auto list = [](const char* title, const json& items) {
    std::string html;
    for (const json& item : items) html += fmt::format("<p>{}</p>", Escape(AsText(item)));
    return html.empty() ? "" : fmt::format("<div><h2>{}</h2>{}</div>\n", title, html);
  };
  const char* tone = verdict == "outside_family"                 ? "poor"
                     : verdict == "gap_narrowed"                 ? "fair"
                     : verdict.empty() || verdict == "undecided" ? "open"
                                                                 : "good";
  // The verdict in large letters, what it rests on in small ones.
  const std::string sentence = TextAt(summary, "headline");
  const size_t end = std::min(sentence.find(". "), sentence.size() - 1) + 1;
  const std::string rest =
      end >= sentence.size() ? "" : fmt::format("<p class=\"rest\">{}</p>\n", Escape(sentence.substr(end + 1)));
  return fmt::format("<header class=\"{}\" id=\"top\"><p class=\"eyebrow\">{}</p><h1>{}</h1>\n", tone,
                     Escape(TextAt(report, "title")), Escape(sentence.substr(0, end))) +
         rest +
         fmt::format("<p class=\"asked\">{}</p>\n<div class=\"answer\">{}{}{}</div></header>\n",
                     Escape(TextAt(summary, "asked")), list("What came out", summary.at("found")),
                     list("How far to trust it", summary.at("trust")),
                     list("What stays unknown", summary.at("unknown")));
}

}  // namespace

std::filesystem::path PlotlyFile() {
  const char* const chosen = std::getenv("OTED_PLOTLY_JS");
  const std::filesystem::path path = chosen != nullptr && *chosen != '\0' ? chosen : FoundPackages().plotly_js;
  std::error_code failed;
  if (!std::filesystem::is_regular_file(path, failed)) {
    throw DataError(
        fmt::format("the report needs plotly.min.js, and '{}' is no file; run 'make setup', or set "
                    "OTED_PLOTLY_JS to a copy of plotly.min.js",
                    path.string()));
  }
  return path;
}

std::string PlotlyJs() {
  const std::filesystem::path path = PlotlyFile();
  const std::string text = ReadFile(path);
  return IsGzip(text) ? Gunzip(text, path.string()) : text;
}

std::string HtmlDocument(std::string_view title, std::string_view navigation, std::string_view body,
                         std::string_view footer, std::string_view plotly_js) {
  std::string page = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n"
      "<link rel=\"icon\" href=\"data:,\">\n<title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n",
      kPolicy, title, PageStyle());
  page += fmt::format("<nav aria-label=\"Contents\"><div>{}</div></nav>\n<main>\n", navigation);
  page += body;
  page += fmt::format("<footer>{}</footer>\n</main>\n", footer);
  page += "<script>";
  page += plotly_js;
  page += "</script>\n<script>\n";
  page += PlotsScript();
  page += "\n";
  page += PlayerScript();
  page += "</script>\n</body>\n</html>\n";
  return page;
}

std::string HtmlPage(const json& report, std::string_view plotly_js) {
  const std::vector<Section> sections = {
      ParametersSection(report), ValidationSection(report),      ReplaySection(report),        PoliciesSection(report),
      WarningsSection(report),   DesignSection(report),          DiscriminatorSection(report), SelectionSection(report),
      AgentsSection(report),     PolicySelectionSection(report), DataSection(report),          CloneSection(report),
      RunSection(report)};
  const std::string title = Escape(TextAt(report, "title"));
  std::string contents = fmt::format("<a class=\"home\" href=\"#top\">{}</a>", title);
  std::string body =
      Header(report) + "<noscript><p class=\"note\">The plots need JavaScript; the tables do not.</p></noscript>\n";
  for (const Section& section : sections) {
    if (section.html.empty()) continue;
    contents += fmt::format("<a href=\"#{}\">{}</a>", section.id, section.label);
    body += fmt::format("<section id=\"{}\"><h2>{}</h2>\n{}</section>\n", section.id, section.title, section.html);
  }
  return HtmlDocument(fmt::format("{} – simulator design", title), contents, body,
                      "Made by oted from the files of this run; report.json has the same as data.", plotly_js);
}

}  // namespace oted
