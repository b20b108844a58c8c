// A load beside a vertical axis turns alike on either side of it, one beside a level axis does not.

#include "oted/stages/design/trajectories/mirrored_values.h"

#include <gtest/gtest.h>

#include <string>

#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/testing.h"
#include "oted/stages/design/trajectories/testing.h"

namespace oted::mirrored_values_test {

std::string TurningAbout(const std::string& axis) {
  return R"(<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody><body name="load"><joint name="hinge" axis=")" +
         axis + R"(" damping="0.05"/>
    <geom type="box" pos="0.1 0 0" size="0.05 0.04 0.02" mass="0.5"/></body></worldbody>
  <actuator><motor name="motor" joint="hinge" ctrlrange="-3 3"/></actuator>
</mujoco>)";
}

/// Where the load's centre is found aside of its arm, and what the fit says of its negative.
std::vector<MirroredValue> FoundBeside(const std::string& axis, double truth, double low) {
  const TestFolder folder;
  const ParameterSpec aside = {
      .name = "aside", .field = "body/load/ipos[1]", .low = low, .high = 0.12, .scale = ParameterScale::kAbsolute};
  const MujocoSimulatorFactory factory(HingeTask(folder, TurningAbout(axis).c_str()), {aside});
  const Dataset logs = WithSensorNoise(LogsUnderTorques(factory, {truth}, 0.3), 0.0005, RngKey(3));
  const ReplayFit fit = BriefFit(factory, logs);
  EXPECT_NEAR(std::abs(ToZ(factory.parameters(), fit.mean)[0]), truth, 0.01);
  return fit.evidence->mirrored;
}

TEST(FindMirrored, NamesASideThatNoLogTells) {
  const std::vector<MirroredValue> found = FoundBeside("0 0 1", 0.08, -0.12);
  ASSERT_EQ(found.size(), 1);
  EXPECT_EQ(found.front().parameter, 0);
  EXPECT_LT(found.front().interval90.low, found.front().interval90.high);
  EXPECT_NEAR(std::abs(found.front().interval90.low + found.front().interval90.high) / 2, 0.08, 0.01);
}

TEST(FindMirrored, GravityTellsTheSide) { EXPECT_TRUE(FoundBeside("1 0 0", 0.08, -0.12).empty()); }

TEST(FindMirrored, ASideThatTheSearchExcludesIsNone) { EXPECT_TRUE(FoundBeside("0 0 1", 0.08, 0.0).empty()); }

}  // namespace oted::mirrored_values_test
