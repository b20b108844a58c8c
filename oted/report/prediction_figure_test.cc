#include "oted/report/prediction_figure.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace oted {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

json Channel(const std::string& name, double designed, double floor, bool judged = true) {
  return {{"name", name},   {"unit", "rad"}, {"nominal", 0.2},  {"designed", designed},
          {"floor", floor}, {"spread", 2.0}, {"judged", judged}};
}

TEST(PredictionFigure, ErrorsAreSharesOfASpreadAndTheFarthestFromTheFloorComesFirst) {
  const std::string html =
      PredictionFigure({{"seconds", 0.5}, {"channels", {Channel("near", 0.02, 0.02), Channel("far", 0.1, 0.01)}}});
  EXPECT_THAT(html, HasSubstr(R"("ticktext":["far","near"])"));
  EXPECT_THAT(html, HasSubstr("[0.05,0.01]")) << "designed: 0.1 and 0.02 of a spread of 2";
}

TEST(PredictionFigure, WhatJudgesNothingIsNotDrawn) {
  const json channels = {Channel("position", 0.02, 0.02), Channel("velocity", 0.02, 0.02, false)};
  EXPECT_THAT(PredictionFigure({{"seconds", 0.5}, {"channels", channels}}), Not(HasSubstr("velocity")));
  EXPECT_EQ(PredictionFigure({{"seconds", 0.5}, {"channels", json::array({channels[1]})}}), "");
}

}  // namespace
}  // namespace oted
