// The residual force of joints: what a joint does under it, in closed form.

#include "oted/sim/mujoco/joint_residual.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/testing.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/presets.h"

namespace oted::joint_residual_test {

constexpr double kInertia = 0.02, kPeriod = 0.02, kStep = 0.001;

/// A wheel about a vertical axis with a motor, and a ball on a free joint that nothing drives.
constexpr const char* kXml = R"(<mujoco>
  <option timestep="0.001" integrator="Euler" gravity="0 0 0"/>
  <worldbody>
    <body><freejoint name="ball"/><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/></body>
    <body><joint name="wheel" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/></body>
  </worldbody>
  <actuator><motor name="wheel" joint="wheel" gear="2" ctrlrange="-1 1" forcerange="-1 1"/></actuator>
</mujoco>)";

std::vector<ParameterSpec> Weights() {
  std::vector<ParameterSpec> specs;
  for (int k = 0; k < kResidualSize; ++k) {
    specs.push_back({.name = kResidualTerms[static_cast<size_t>(k)],
                     .field = "joint/wheel/residual[" + std::to_string(k) + "]",
                     .low = -1,
                     .high = 1,
                     .scale = ParameterScale::kAbsolute});
  }
  return specs;
}

const MujocoSimulatorFactory& Factory() {
  static const TestFolder folder;
  static const auto factory = [] {
    WriteFileAtomically(folder / "wheel.xml", kXml);
    ModelTask task;
    task.name = "Wheel";
    task.model = folder / "wheel.xml";
    task.control_period = kPeriod;
    task.observations = {"joint/wheel/qpos", "joint/wheel/qvel"};
    task.max_episode_steps = 1000;
    return std::make_unique<MujocoSimulatorFactory>(task, Weights());
  }();
  return *factory;
}

/// Position and velocity of the wheel after a control period.
std::vector<double> After(Simulator& simulator, const std::vector<double>& z, double q, double v, double torque) {
  simulator.SetParameters(0, z);
  Rng rng(1);
  std::vector<double> qpos(8, 0.0), qvel(7, 0.0);
  qpos[3] = 1;
  qpos[7] = q;
  qvel[6] = v;
  simulator.ResetTo(0, qpos, qvel, rng);
  const int lane = 0;
  simulator.Step({&lane, 1}, std::vector<double>{torque});
  return {simulator.observation(0).begin(), simulator.observation(0).end()};
}

TEST(JointResidual, IsTheSumOfItsTerms) {
  const auto simulator = Factory().Make(1, 1);
  const std::vector<double> w = {0.1, -0.3, 0.2, 0.15, -0.25, 0.05, -0.08};
  for (const double q0 : {0.0, 1.1, -2.0}) {
    double q = q0, v = 1.5;
    for (int i = 0; i < std::lround(kPeriod / kStep); ++i) {  // MuJoCo's semi-implicit Euler
      const double force = w[0] + w[1] * std::sin(q) + w[2] * std::cos(q) + w[3] * std::sin(2 * q) +
                           w[4] * std::cos(2 * q) + w[5] * std::tanh(v) + w[6] * v * std::abs(v);
      v += kStep * (2 * 0.2 + force) / kInertia;
      q += kStep * v;
    }
    const std::vector<double> shown = After(*simulator, w, q0, 1.5, 0.2);
    EXPECT_NEAR(shown[0], q, 1e-12) << q0;
    EXPECT_NEAR(shown[1], v, 1e-12) << q0;
  }
}

TEST(JointResidual, NominalIsNone) {
  const auto simulator = Factory().Make(1, 1);
  const std::vector<double> shown = After(*simulator, Factory().parameters().Nominal(), 0.3, 1.5, 0.1);
  EXPECT_NEAR(shown[1], 1.5 + kPeriod * 2 * 0.1 / kInertia, 1e-12);
}

TEST(JointResidual, LeavesNothingBehindInALane) {
  const auto simulator = Factory().Make(1, 1);
  const std::vector<double> z = {0.1, 0, 0.2, 0, 0, 0.1, 0};
  const std::vector<double> fresh = After(*simulator, z, 0.4, 1, 0.1);
  After(*simulator, {1, 1, -1, 1, 1, 1, -1}, 2, 8, 1);
  EXPECT_EQ(After(*simulator, z, 0.4, 1, 0.1), fresh);
}

TEST(JointResidual, PathsThatNoMjcfHoldsAreThoseOfTheFieldAndNotOfAJointOfThatName) {
  EXPECT_TRUE(IsResidualPath("joint/elbow/residual[2]"));
  EXPECT_TRUE(IsResidualPath("joint/elbow/damping + joint/elbow/residual"));
  EXPECT_FALSE(IsResidualPath("joint/residual/damping"));
  EXPECT_FALSE(IsResidualPath("joint/residual_arm/damping"));
}

TEST(JointResidual, ReachIsAFifthOfWhatTheMotorsCanDo) {
  EXPECT_DOUBLE_EQ(ResidualReach(Factory().model()), 0.5) << "of 2 N m, rounded up";
}

TEST(ResidualPreset, HasEachTermOfEachDrivenJointBelievedToBeNearZero) {
  const MujocoSimulatorFactory factory("Hopper-v5", {});
  const ExpandedPresets expanded = ExpandPresets({"residual"}, {}, factory);
  ASSERT_EQ(expanded.parameters.size(), 3 * kResidualTerms.size());
  EXPECT_TRUE(expanded.has_beliefs);
  EXPECT_EQ(expanded.parameters[0].name, "residual_thigh_joint_constant");
  EXPECT_EQ(expanded.parameters[8].field, "joint/leg_joint/residual[1]");
  for (const ParameterSpec& spec : expanded.parameters) {
    EXPECT_EQ(spec.low, -spec.high);
    ASSERT_TRUE(spec.prior.has_value());
    EXPECT_EQ(spec.prior->mean, 0);
    EXPECT_LT(spec.prior->std, spec.high / 4);
  }
}

}  // namespace oted::joint_residual_test
