#include "oted/matching/held_out_prediction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

namespace oted::held_out_prediction_test {

TEST(HeldOutPrediction, ComesBackFromTheTextOfItsJson) {
  HeldOutPrediction::Horizon horizon;
  horizon.seconds = 0.5;
  horizon.n_steps = 25;
  horizon.n_windows = 7;
  horizon.learned = true;
  horizon.channels = {{.nominal = std::numeric_limits<double>::quiet_NaN(),
                       .designed = 0.25,
                       .floor = 0.125,
                       .spread = 0.75,
                       .judged = false,
                       .excess = {0.5, 0.0625},
                       .gain = {1.5, 2}}};
  horizon.excess = {3, 4};
  horizon.gain = {5, 6};
  horizon.n_of_recordings = 3;
  horizon.gain_of_recordings = {7, 8};
  const nlohmann::json written = nlohmann::json::parse(
      ToJson({.horizons = {horizon}, .n_recordings = 1, .n_parts = 4, .open_ends = {{.parameter = 2, .above = true}}})
          .dump());
  const HeldOutPrediction read = HeldOutPredictionFromJson(written);
  EXPECT_EQ(ToJson(read).dump(), written.dump());
  EXPECT_EQ(read.n_parts, 4);
  EXPECT_TRUE(std::isnan(read.horizons[0].channels[0].nominal)) << "its physics broke down";
  EXPECT_THROW(HeldOutPredictionFromJson(nlohmann::json::object()), nlohmann::json::exception);
}

}  // namespace oted::held_out_prediction_test
