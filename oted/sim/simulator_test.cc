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

}  // namespace oted::simulator_test
