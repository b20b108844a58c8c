#include "oted/report/prediction_figure.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "oted/report/figure.h"
#include "oted/report/html_text.h"
#include "oted/report/json_values.h"

namespace oted {
namespace {

using nlohmann::json;

constexpr size_t kMostDrawn = 24;
constexpr double kSmallestShown = 1e-4;  // of a spread: smaller errors are drawn there

struct Errors {
  std::string name, unit;
  double spread = 0;
  std::optional<double> nominal, designed, floor;

  /// How much more the design leaves than the sensors would.
  double Excess() const { return designed && floor && *floor > 0 ? *designed / *floor : 0; }
};

std::vector<Errors> Judged(const json& horizon) {
  std::vector<Errors> judged;
  for (const json& channel : ListAt(horizon, "channels")) {
    const double spread = NumberAt(channel, "spread").value_or(0);
    if (!channel.value("judged", true) || !(spread > 0)) continue;
    judged.push_back({TextAt(channel, "name"), TextAt(channel, "unit"), spread, NumberAt(channel, "nominal"),
                      NumberAt(channel, "designed"), NumberAt(channel, "floor")});
  }
  return judged;
}

/// Labels of a logarithmic axis that leave each other room: 1, 2 and 5 of each decade, or the decades alone.
json TicksOver(double least, double most) {
  constexpr double kFewDecades = 2;
  return std::log10(most / least) < kFewDecades ? json("D2") : json(1);
}

}  // namespace

std::string PredictionFigure(const json& horizon) {
  std::vector<Errors> channels = Judged(horizon);
  const size_t n_judged = channels.size();
  if (channels.empty()) return "";
  std::ranges::stable_sort(channels, [](const Errors& a, const Errors& b) { return a.Excess() > b.Excess(); });
  channels.resize(std::min(channels.size(), kMostDrawn));
  Figure figure(fmt::format("Error over {} s, as a share of how much the channel moves in the logs{}",
                            FormatGiven(NumberAt(horizon, "seconds")),
                            n_judged > kMostDrawn
                                ? fmt::format("; the {} of {} channels farthest from the floor", kMostDrawn, n_judged)
                                : ""));
  double least = 1, most = kSmallestShown;
  const auto share = [&](const Errors& errors, const std::optional<double>& error) {
    if (!error) return json();
    const double of_spread = std::max(*error / errors.spread, kSmallestShown);
    least = std::min(least, of_spread);
    most = std::max(most, of_spread);
    return json(of_spread);
  };
  std::vector<std::string> names;
  for (const Errors& errors : channels) {
    const size_t row = names.size();
    names.push_back(errors.name);
    figure.AddTrace({{"type", "scatter"},
                     {"mode", "lines"},
                     {"x", {share(errors, errors.nominal), share(errors, errors.designed)}},
                     {"y", {row, row}},
                     {"hoverinfo", "skip"},
                     {"line", {{"color", "var:--edge"}, {"width", 2}}}});
  }
  const auto add = [&](const char* words, std::optional<double> Errors::*error, const json& marker) {
    json x = json::array(), y = json::array();
    std::vector<std::string> texts;
    for (const Errors& errors : channels) {
      x.push_back(share(errors, errors.*error));
      y.push_back(y.size());
      texts.push_back(fmt::format("{}: {} {} {}", errors.name, words, FormatNumber(errors.*error), errors.unit));
    }
    figure.AddMarkers(x, y, texts, marker);
  };
  add("sensors alone", &Errors::floor,
      {{"color", "var:--muted"}, {"symbol", "line-ns-open"}, {"size", 16}, {"line", {{"width", 2.5}}}});
  add("nominal", &Errors::nominal, {{"color", "var:--nominal"}, {"size", 10}});
  add("designed", &Errors::designed, {{"color", "var:--designed"}, {"size", 10}});
  SetRows(figure, names);
  figure.layout()["xaxis"] = {{"type", "log"}, {"tickformat", "~%"}, {"dtick", TicksOver(least, most)}};
  PlotKey key;
  key.Add("line", "--nominal", "nominal simulator").Add("line", "--designed", "designed simulator");
  key.Add("line", "--muted", "what the sensors alone would leave");
  return WithKey(key, figure.Html("rows"));
}

}  // namespace oted
