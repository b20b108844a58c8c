#include "oted/sim/simulator.h"

#include <gtest/gtest.h>

#include "oted/base/error.h"

namespace oted::simulator_test {

TEST(SimulatorSpec, ObservationSizeIsTheProductOfItsShape) {
  SimulatorSpec spec;
  EXPECT_EQ(spec.obs_dim(), 0);
  spec.observation_shape = {11};
  EXPECT_EQ(spec.obs_dim(), 11);
  spec.observation_shape = {7, 7, 3};
  EXPECT_EQ(spec.obs_dim(), 147);
}

TEST(SimulatorSpec, TheScoreIs0ForTheRandomAnd100ForTheExpertReturn) {
  SimulatorSpec spec;
  EXPECT_FALSE(spec.has_score());
  EXPECT_THROW(spec.NormalizedScore(1), InternalError);
  spec.return_random = -20.272305;
  spec.return_expert = 3234.3;
  EXPECT_TRUE(spec.has_score());
  EXPECT_DOUBLE_EQ(spec.NormalizedScore(-20.272305), 0);
  EXPECT_DOUBLE_EQ(spec.NormalizedScore(3234.3), 100);
  EXPECT_DOUBLE_EQ(spec.NormalizedScore((3234.3 - 20.272305) / 2), 50);
}

/// A drive without limits takes what was logged, whatever agents may use.
TEST(SimulatorSpec, TheMeanOfTwoActionsIsOfWhatTheSimulatorTakesThemFor) {
  SimulatorSpec spec;
  spec.action_low = {-1, -1};
  spec.action_high = {1, 1};
  EXPECT_DOUBLE_EQ(spec.MeanAction(0, 3, 0.5, 0.25), 0.625);
  spec.bounds_action = {1, 0};
  EXPECT_DOUBLE_EQ(spec.MeanAction(0, 3, 0.5, 0.25), 0.625);
  EXPECT_DOUBLE_EQ(spec.MeanAction(1, 3, 0.5, 0.25), 1.125);
}

}  // namespace oted::simulator_test
