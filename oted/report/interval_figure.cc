#include "oted/report/interval_figure.h"

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

/// Where values lie in a parameter's range: 0 at its lower end, 1 at its upper one.
class Range {
 public:
  explicit Range(const json& parameter) : is_log_(TextAt(parameter, "scale") == "log") {
    const json& bounds = ListAt(parameter, "bounds");
    if (bounds.size() != 2) return;
    low_ = AsNumber(bounds[0]).value_or(0);
    high_ = AsNumber(bounds[1]).value_or(0);
  }
  bool is_known() const { return low_ < high_ && !(is_log_ && low_ <= 0); }
  /// At most a little beyond an end: a truth or a nominal value may lie outside.
  json At(std::optional<double> value) const {
    if (!value) return nullptr;
    const double share =
        is_log_ ? std::log(std::max(*value, 1e-300) / low_) / std::log(high_ / low_) : (*value - low_) / (high_ - low_);
    return std::clamp(share, -0.03, 1.03);
  }

 private:
  bool is_log_;
  double low_ = 0, high_ = 0;
};

/// Markers of one kind, one per parameter.
struct Markers {
  json x = json::array(), y = json::array();
  std::vector<std::string> texts;

  void Add(const json& at, size_t row, const std::string& words) {
    if (at.is_null()) return;
    x.push_back(at);
    y.push_back(row);
    texts.push_back(words);
  }
  void AddTo(Figure& figure, const json& marker) const {
    if (!x.empty()) figure.AddMarkers(x, y, texts, marker);
  }
};

json Line(const json& x, size_t row, const char* color, int width) {
  return {{"type", "scatter"}, {"mode", "lines"},     {"x", x},
          {"y", {row, row}},   {"hoverinfo", "skip"}, {"line", {{"color", color}, {"width", width}}}};
}

}  // namespace

std::string IntervalFigure(const json& parameters) {
  Figure figure("Intervals within the ranges that were searched");
  Markers designed, nominal, truth;
  std::vector<std::string> names;
  for (const json& parameter : parameters) {
    const Range range(parameter);
    const json& interval = ListAt(parameter, "interval90");
    if (!range.is_known() || interval.size() != 2) continue;
    const size_t row = names.size();
    const std::string name = TextAt(parameter, "name"), unit = TextAt(parameter, "unit");
    names.push_back(name);
    const std::optional<double> spread = NumberAt(parameter, "std");
    const auto words = [&](const char* what, const std::string& value) {
      return fmt::format("{}: {} {} {}", name, what, value, unit);
    };
    figure.AddTrace(Line({0, 1}, row, "var:--edge", 1));
    figure.AddTrace(Line({range.At(AsNumber(interval[0])), range.At(AsNumber(interval[1]))}, row, "var:--designed", 5));
    designed.Add(range.At(NumberAt(parameter, "mode")), row,
                 words("designed", FormatSpread(NumberAt(parameter, "mode"), spread)));
    nominal.Add(range.At(NumberAt(parameter, "nominal")), row,
                words("nominal", FormatGiven(NumberAt(parameter, "nominal"))));
    truth.Add(range.At(NumberAt(parameter, "truth")), row, words("truth", FormatGiven(NumberAt(parameter, "truth"))));
  }
  if (names.empty()) return "";
  nominal.AddTo(figure,
                {{"color", "var:--nominal"}, {"symbol", "line-ns-open"}, {"size", 16}, {"line", {{"width", 2.5}}}});
  designed.AddTo(figure, {{"color", "var:--designed"}, {"size", 11}});
  truth.AddTo(figure, {{"color", "var:--truth"}, {"symbol", "diamond-open"}, {"size", 12}, {"line", {{"width", 2}}}});
  SetRows(figure, names);
  figure.layout()["xaxis"] = {{"range", {-0.05, 1.05}}, {"tickvals", {0, 1}}, {"ticktext", {"lower end", "upper end"}}};
  PlotKey key;
  key.Add("band", "--designed", "90 % interval, and the designed value").Add("line", "--nominal", "nominal value");
  if (!truth.x.empty()) key.Add("dash", "--truth", "truth");
  return WithKey(key, figure.Html("rows"));
}

}  // namespace oted
