#include "oted/report/study_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "oted/base/files.h"
#include "oted/report/figure.h"
#include "oted/report/html_page.h"
#include "oted/report/html_text.h"
#include "oted/report/json_values.h"

namespace oted {
namespace {

using nlohmann::json;

constexpr std::array kColours = {"--designed", "--low", "--nominal", "--muted"};
constexpr double kBandOpacity = 0.16;

/// The names of all lines, in the order in which they appear.
std::vector<std::string> LineNames(const json& study) {
  std::vector<std::string> names;
  for (const json& panel : study.at("panels")) {
    for (const json& line : panel.at("lines")) {
      const std::string name = TextAt(line, "name");
      if (std::ranges::find(names, name) == names.end()) names.push_back(name);
    }
  }
  return names;
}

const char* ColourOf(const std::string& name, const std::vector<std::string>& names) {
  return kColours[static_cast<size_t>(std::ranges::find(names, name) - names.begin()) % kColours.size()];
}

std::string Panel(const json& panel, const std::vector<std::string>& names, const std::string& level_name) {
  Figure figure(Escape(TextAt(panel, "title")));
  const auto colour = [&](const json& line) { return fmt::format("var:{}", ColourOf(TextAt(line, "name"), names)); };
  for (const json& line : panel.at("lines")) {
    figure.AddRange(line.at("steps"), line.at("low"), line.at("high"), colour(line), kBandOpacity);
  }
  for (const json& line : panel.at("lines")) {
    json points = json::array();
    for (size_t i = 0; i < line.at("steps").size(); ++i) points.push_back({line["steps"][i], line["median"][i]});
    figure.AddCurve(points, TextAt(line, "name"), {.color = colour(line), .width = 2});
  }
  for (const json& line : panel.at("lines")) {
    if (!line.contains("level")) continue;
    figure.AddLevel(line["level"], TextAt(line, "name") + ", " + level_name,
                    {.color = colour(line), .width = 1.2, .dash = "dash"});
  }
  figure.SetXTitle(TextAt(panel, "x"));
  figure.layout()["yaxis"]["rangemode"] = "tozero";
  return figure.Html();
}

std::string Table(const json& study) {
  HtmlTable table;
  for (const json& column : study.at("columns")) table.Column(AsText(column));
  for (const json& row : study.at("rows")) {
    std::vector<std::string> cells;
    for (const json& cell : row) cells.push_back(Escape(AsText(cell)));
    table.Row(std::move(cells));
  }
  return table.Html();
}

}  // namespace

void WriteStudyPage(const json& study, const std::filesystem::path& path) {
  const std::string title = Escape(TextAt(study, "title"));
  std::string body = fmt::format("<header id=\"top\"><p class=\"eyebrow\">{}</p><h1>{}</h1>\n", title,
                                 Escape(TextAt(study, "headline")));
  for (const json& paragraph : study.at("text")) body += fmt::format("<p>{}</p>\n", Escape(AsText(paragraph)));
  body += "</header>\n<noscript><p class=\"note\">The plots need JavaScript; the table does not.</p></noscript>\n";

  const std::vector<std::string> names = LineNames(study);
  PlotKey key;
  for (const std::string& name : names) key.Add("line", ColourOf(name, names), Escape(name));
  key.Add("dash", "--soft", Escape(TextAt(study, "level_name")));
  std::string figures;
  for (const json& panel : study.at("panels")) figures += Panel(panel, names, TextAt(study, "level_name"));
  body += fmt::format("<section id=\"curves\"><h2>Curves</h2>\n{}</section>\n", WithKey(key, FigureGrid(figures)));
  body += fmt::format("<section id=\"table\"><h2>At the end</h2>\n{}</section>\n", Table(study));

  const std::string navigation = fmt::format(
      "<a class=\"home\" href=\"#top\">{}</a><a href=\"#curves\">Curves</a><a href=\"#table\">Table</a>", title);
  WriteFileAtomically(path,
                      HtmlDocument(title, navigation, body, "Made by oted from the files beside it.", PlotlyJs()));
}

}  // namespace oted
