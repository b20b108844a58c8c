// What values rest on in MuJoCo's models: what the logs cannot tell from a parameter at all is named, however little a
// tenth of it does.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/stages/design/testing.h"
#include "oted/stages/design/trajectories/testing.h"

namespace oted::rests_on_design_test {

/// A servo's kv and the damping of its joint are one term: 0.05 beside 0.5.
constexpr const char* kXml = R"(<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody><body><joint name="hinge" axis="0 1 0" damping="0.05"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.02" mass="0.5"/></body></worldbody>
  <actuator><position name="motor" joint="hinge" kp="5" kv="0.5" ctrlrange="-3 3"/></actuator>
</mujoco>)";

TEST(DesignOfAServo, NamesTheDampingThatNoLogTellsFromItsOwn) {
  constexpr double kTruth = 1.2;
  const TestFolder folder;
  const ParameterSpec kv = {.name = "kv", .field = "actuator/*/kv", .low = 0.5, .high = 2};
  const MujocoSimulatorFactory factory(HingeTask(folder, kXml), {kv});
  const Dataset logs = WithSensorNoise(LogsUnderTorques(factory, {kTruth}, 0.9), 0.001, RngKey(3));
  const ReplayFit fit = BriefFit(factory, logs);
  std::vector<std::string> fields;
  for (const Condition& condition : fit.evidence->conditions) {
    fields.push_back(condition.spec.field);
    if (condition.spec.field == "joint/*/damping") {
      EXPECT_NEAR(condition.value, kTruth - 0.1 * 0.05 / 0.5, 0.002) << "as much less as the damping is more";
    }
  }
  EXPECT_THAT(fields, testing::Contains("joint/*/damping"));
}

}  // namespace oted::rests_on_design_test
