#include "oted/report/interval_figure.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "oted/report/figure.h"

namespace oted {
namespace {

using nlohmann::json;

/// The traces that a figure's HTML holds.
json Traces(const std::string& html) {
  const std::string open = "<script type=\"application/json\">";
  const size_t begin = html.find(open) + open.size();
  return json::parse(html.substr(begin, html.find("</script>") - begin))["data"];
}

json Parameter(const char* scale, double low, double high, double mode) {
  return {{"name", "p"},    {"unit", "x nominal"}, {"nominal", 1}, {"bounds", {low, high}},
          {"scale", scale}, {"mode", mode},        {"std", 0.1},   {"interval90", {low, mode}}};
}

TEST(IntervalFigure, ValuesLieOnTheScaleOnWhichTheyWereSearched) {
  // Traces: the range, the interval, nominal values, designed ones.
  const json linear = Traces(IntervalFigure(json::array({Parameter("linear", 0, 4, 2)})));
  EXPECT_EQ(linear[1]["x"], json({0.0, 0.5}));
  EXPECT_EQ(linear[2]["x"], json({0.25}));
  EXPECT_EQ(linear[3]["x"], json({0.5}));
  const json logarithmic = Traces(IntervalFigure(json::array({Parameter("log", 0.1, 10, 10)})));
  EXPECT_NEAR(logarithmic[2]["x"][0].get<double>(), 0.5, 1e-12);
  EXPECT_NEAR(logarithmic[3]["x"][0].get<double>(), 1, 1e-12);
}

TEST(IntervalFigure, ARangeThatIsNotKnownHasNoLine) {
  json unknown = Parameter("linear", 0, 4, 2);
  unknown.erase("bounds");
  EXPECT_EQ(IntervalFigure(json::array({unknown})), "");
  EXPECT_EQ(IntervalFigure(json::array()), "");
}

}  // namespace
}  // namespace oted
