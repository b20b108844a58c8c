#include "oted/report/sections_replay.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/report/figure.h"
#include "oted/report/json_values.h"

namespace oted {
namespace {

using nlohmann::json;

constexpr size_t kMostChannels = 6;

const LineStyle kLogged = {.color = "var:--truth", .width = 2, .dash = "dot"};
const LineStyle kNominal = {.color = "var:--nominal", .width = 2};
const LineStyle kDesigned = {.color = "var:--designed", .width = 2};

// Values at 0, 1, 2, ... control steps as [seconds, value]; steps where there is no unit of time.
json OverTime(const json& values, double period) {
  json points = json::array();
  for (size_t t = 0; t < values.size(); ++t) points.push_back({static_cast<double>(t) * period, values[t]});
  return points;
}

std::string AxisTitle(const json& replay) {
  return NumberAt(replay, "control_period_s").value_or(0) > 0 ? "time [s]" : "step";
}

double Period(const json& replay) {
  const double period = NumberAt(replay, "control_period_s").value_or(0);
  return period > 0 ? period : 1;
}

std::string ErrorFigure(const json& replay) {
  if (!replay.contains("error")) return "";
  const json& error = replay["error"];
  Figure figure("Distance from the logs over time, in standard deviations of the logs");
  for (const auto& [name, label, style] : {std::tuple("nominal", "nominal simulator", kNominal),
                                           std::tuple("designed", "designed simulator", kDesigned)}) {
    if (!error.contains(name)) continue;
    const auto curve = [&](const char* quantile) { return OverTime(ListAt(error[name], quantile), Period(replay)); };
    figure.AddCurve(curve("median"), label, style);
    for (const char* quantile : {"low", "high"}) {
      figure.AddCurve(curve(quantile), fmt::format("{}, a quarter of the stretches lies beyond", label),
                      {.color = style.color, .width = 1.2, .dash = "dash", .opacity = 0.8});
    }
  }
  figure.SetXTitle(AxisTitle(replay));
  figure.layout()["yaxis"] = {{"rangemode", "tozero"}};
  PlotKey key;
  key.Add("line", "--nominal", "nominal simulator, median stretch")
      .Add("line", "--designed", "designed simulator, median stretch")
      .Add("dash", "--soft", "a quarter of the stretches lies below, a quarter above");
  return WithKey(key, figure.Html("wide short"));
}

std::string ChannelFigures(const json& replay) {
  std::string figures;
  const json& channels = ListAt(replay, "channels");
  for (size_t i = 0; i < std::min(channels.size(), kMostChannels); ++i) {
    Figure figure("<b>" + Escape(TextAt(channels[i], "name")) + "</b>" + UnitHtml(TextAt(channels[i], "unit")));
    const auto add = [&](const char* key, const char* name, const LineStyle& style) {
      figure.AddCurve(OverTime(ListAt(channels[i], key), Period(replay)), name, style);
    };
    add("nominal", "nominal simulator", kNominal);
    add("designed", "designed simulator", kDesigned);
    add("logged", "logged", kLogged);
    figure.SetXTitle(AxisTitle(replay));
    figures += figure.Html("small");
  }
  PlotKey key;
  key.Add("dots", "--truth", "logged").Add("line", "--nominal", "nominal simulator");
  key.Add("line", "--designed", "designed simulator");
  return WithKey(key, FigureGrid(figures));
}

std::string Player(const json& motion) {
  const json& panels = ListAt(motion, "panels");
  if (panels.empty()) return "";
  constexpr std::pair<const char*, const char*> kNames[] = {
      {"logged", "Logged"}, {"nominal", "Nominal"}, {"designed", "Designed"}};
  std::string html = fmt::format(
      "<div class=\"motion\" data-columns=\"{}\" data-frames=\"{}\" data-period=\"{}\"><div class=\"panels\">",
      FormatGiven(NumberAt(motion, "columns")), FormatGiven(NumberAt(motion, "n_frames")),
      FormatGiven(NumberAt(motion, "frame_period_s")));
  for (const json& panel : panels) {
    std::string label = TextAt(panel, "name");
    for (const auto& [name, words] : kNames) {
      if (label == name) label = words;
    }
    html += fmt::format(
        "<div class=\"panel {}\"><p>{}</p><canvas width=\"{}\" height=\"{}\" role=\"img\" aria-label=\"{}: the robot's "
        "motion\"></canvas><img alt=\"\" hidden src=\"{}\"></div>",
        Escape(TextAt(panel, "name")), Escape(label), FormatGiven(NumberAt(motion, "width")),
        FormatGiven(NumberAt(motion, "height")), Escape(label), Escape(TextAt(panel, "data")));
  }
  return html +
         "</div><div class=\"controls\"><button type=\"button\">Play</button><input type=\"range\" min=\"0\" "
         "value=\"0\" aria-label=\"moment\"><output>0.00&#8201;s</output></div></div>\n";
}

// Minigrid's kinds: unseen, empty, wall, floor, door, key, ball, box, goal, lava, agent.
constexpr const char* kCellColours[] = {"#3d3d46", "#eceae4", "#8a8478", "#d8d4ca", "#b08d57", "#d9b310",
                                        "#3b6ea5", "#9a6fb0", "#4f9d5d", "#d9642c", "#c23b3b"};

std::string Picture(const json& cells, size_t columns, size_t rows) {
  std::string svg = fmt::format(
      "<svg class=\"cells\" viewBox=\"0 0 {} {}\" width=\"{}\" height=\"{}\" shape-rendering=\"crispEdges\" "
      "role=\"img\">",
      columns, rows, 12 * columns, 12 * rows);
  for (size_t i = 0; i < std::min(cells.size(), columns * rows); ++i) {
    const size_t kind = cells[i].is_number_unsigned() ? cells[i].get<size_t>() : 0;
    // Columns come one after the other.
    svg += fmt::format("<rect x=\"{}\" y=\"{}\" width=\"1\" height=\"1\" fill=\"{}\"/>", i / rows, i % rows,
                       kCellColours[std::min(kind, std::size(kCellColours) - 1)]);
  }
  return svg + "</svg>\n";
}

std::string Pictures(const json& images) {
  const auto columns = static_cast<size_t>(NumberAt(images, "columns").value_or(0));
  const auto rows = static_cast<size_t>(NumberAt(images, "rows").value_or(0));
  if (columns == 0 || rows == 0) return "";
  std::string html =
      "<p>The first view of some episodes: walls are brown, free cells light, hidden cells dark, the goal green. Grids "
      "are drawn at random: compare only how full they are.</p>\n";
  for (const auto& [name, label] : {std::pair("logged", "Logged"), std::pair("designed", "Designed simulator"),
                                    std::pair("nominal", "Nominal simulator")}) {
    html += fmt::format("<p>{}</p>\n<p>", label);
    for (const json& cells : ListAt(images, name)) html += Picture(cells, columns, rows);
    html += "</p>\n";
  }
  return html;
}

std::string Explanation(const json& replay) {
  const json window = replay.value("window", json::object());
  const double n_lead = NumberAt(replay, "n_lead").value_or(0);
  const std::string start =
      n_lead > 0 ? fmt::format(
                       "The logs show a state in part. Each simulator therefore starts where it follows the first "
                       "{} readings best, and gets",
                       FormatCount(n_lead))
                 : "Each simulator starts in a logged state and gets";
  return fmt::format(
      "<p>This section replays the logged actions in both simulators. {} the next {} logged actions, without "
      "correction. The sooner it leaves the log, the worse it fits. Small errors grow, so every simulator leaves it "
      "after a while.</p>\n<p>The stretch shown starts at step {} of episode {}. Of {} stretches spread over the logs "
      "it "
      "is the median one for the designed simulator. The design was made from these logs.</p>\n",
      start, FormatCount(NumberAt(replay, "n_steps")), FormatCount(NumberAt(window, "step")),
      FormatCount(NumberAt(window, "episode")), FormatCount(NumberAt(replay, "n_windows")));
}

}  // namespace

Section ReplaySection(const json& report) {
  Section section{"replay", "Motion", "The same actions again", ""};
  if (!report.contains("replay")) return section;
  const json& replay = report["replay"];
  if (!replay.contains("window")) {
    section.html = fmt::format("<p>{}</p>\n", Escape(TextAt(replay, "note")));
    if (replay.contains("images")) section.html += Pictures(replay["images"]);
    return section;
  }
  const json motion = report.value("motion", json::object());
  section.html = Explanation(replay) + Player(motion);
  if (const std::string note = TextAt(motion, "note"); !note.empty()) {
    section.html += fmt::format("<p class=\"note\">No pictures of the motion: {}.</p>\n", Escape(note));
  }
  section.html += ChannelFigures(replay);
  if (const size_t n = ListAt(replay, "channels").size(); n > kMostChannels) {
    section.html += fmt::format(
        "<p class=\"note\">The figures show the {} of {} channels with the largest error of the nominal simulator. "
        "motion/replay.json has all.</p>\n",
        kMostChannels, n);
  }
  section.html += ErrorFigure(replay);
  return section;
}

}  // namespace oted
