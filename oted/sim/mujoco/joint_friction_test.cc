// Friction beyond MuJoCo's own: what a joint does under it, in closed form.

#include "oted/sim/mujoco/joint_friction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mujoco.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/sim/mujoco/export_mjcf.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"

namespace oted::joint_friction_test {

constexpr double kInertia = 0.02, kPeriod = 0.02, kStep = 0.001;

/// A wheel about a vertical axis, and a slider; a motor on each. The wheel's dry friction in MJCF is 0.01 N m.
constexpr const char* kXml = R"(<mujoco>
  <option timestep="0.001" integrator="INTEGRATOR" gravity="0 0 -9.81"/>
  <worldbody>
    <body name="wheel"><joint name="wheel" axis="0 0 1" frictionloss="0.01"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/></body>
    <body name="cart"><joint name="cart" type="slide" axis="1 0 0"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/></body>
  </worldbody>
  <actuator><motor name="wheel" joint="wheel" ctrlrange="-1 1" ctrllimited="true"/>
    <motor name="cart" joint="cart" ctrlrange="-1 1" ctrllimited="true"/></actuator>
</mujoco>)";

ParameterSpec Absolute(const std::string& name, const std::string& field, double high) {
  return {.name = name, .field = field, .low = 0, .high = high, .scale = ParameterScale::kAbsolute};
}
const std::vector<ParameterSpec> kAll = {
    Absolute("rest", "joint/wheel/stribeck_torque", 1), Absolute("speed", "joint/wheel/stribeck_velocity", 10),
    Absolute("load", "joint/wheel/load_friction", 1), Absolute("dry", "joint/wheel/frictionloss", 1)};

std::unique_ptr<MujocoSimulatorFactory> Factory(const TestFolder& folder,
                                                const std::vector<ParameterSpec>& specs = kAll,
                                                const std::string& integrator = "implicitfast") {
  std::string xml = kXml;
  xml.replace(xml.find("INTEGRATOR"), 10, integrator);
  WriteFileAtomically(folder / "wheel.xml", xml);
  ModelTask task;
  task.name = "Wheel";
  task.model = folder / "wheel.xml";
  task.control_period = kPeriod;
  task.observations = {"joint/*/qpos", "joint/*/qvel"};
  task.max_episode_steps = 1000;
  return std::make_unique<MujocoSimulatorFactory>(task, specs);
}

constexpr size_t kWheelSpeed = 2, kCartSpeed = 3;

/// What is observed after `n` control periods from these speeds of wheel and cart, under constant torques.
std::vector<double> After(Simulator& simulator, const std::vector<double>& z, const std::vector<double>& speeds,
                          const std::vector<double>& torques, int n = 1) {
  simulator.SetParameters(0, z);
  EXPECT_TRUE(simulator.SetStateFromObservation(0, std::vector<double>{0, 0, speeds[0], speeds[1]}));
  const int lane = 0;
  for (int i = 0; i < n; ++i) simulator.Step({&lane, 1}, torques);
  return {simulator.observation(0).begin(), simulator.observation(0).end()};
}

const TestFolder& Folder() {
  static const TestFolder folder;
  return folder;
}

/// Explicit steps of the wheel's own equation.
double WheelAfter(double speed, double torque, double rest, double stribeck_velocity, double load, double dry) {
  for (int i = 0; i < std::lround(kPeriod / kStep); ++i) {
    const double ratio = speed / stribeck_velocity;
    const double friction = dry + rest * std::exp(-ratio * ratio) + load * std::abs(torque);
    speed += kStep * (torque - std::copysign(friction, speed)) / kInertia;
  }
  return speed;
}

TEST(JointFriction, FallsWithSpeedAndGrowsWithTheMotorsTorque) {
  for (const char* integrator : {"Euler", "implicitfast", "RK4"}) {
    const auto simulator = Factory(Folder(), kAll, integrator)->Make(1, 1);
    for (const double speed : {0.5, 1.0, 4.0, -1.0}) {
      const std::vector<double> shown = After(*simulator, {0.1, 1.2, 0.3, 0.02}, {speed, 1}, {0.2, 0.1});
      EXPECT_NEAR(shown[kWheelSpeed], WheelAfter(speed, 0.2, 0.1, 1.2, 0.3, 0.02), 2e-3) << integrator << " " << speed;
      EXPECT_NEAR(shown[kCartSpeed], 1 + 0.1 * kPeriod, 1e-9) << "another joint has none";
    }
  }
}

TEST(JointFriction, HoldsWhatItCanHold) {
  const auto simulator = Factory(Folder())->Make(1, 1);
  const std::vector<double> z = {0.1, 0.5, 0, 0.02};  // 0.12 N m at rest, 0.02 at speed
  EXPECT_LT(std::abs(After(*simulator, z, {0, 0}, {0.1, 0}, 20)[kWheelSpeed]), 0.02) << "sticks";
  EXPECT_GT(After(*simulator, z, {0, 0}, {0.14, 0}, 20)[kWheelSpeed], 0.7) << "breaks away";
  EXPECT_GT(After(*simulator, z, {2, 0}, {0.1, 0}, 20)[kWheelSpeed], 2) << "what it would hold does not stop it";
}

TEST(JointFriction, NominalIsTheModelItself) {
  const auto with = Factory(Folder())->Make(1, 1), without = Factory(Folder(), {kAll[3]})->Make(1, 1);
  const std::vector<double> shown = After(*with, with->parameters().Nominal(), {0.7, 0.2}, {0.05, 0.3}, 30);
  EXPECT_EQ(shown, After(*without, {0.01}, {0.7, 0.2}, {0.05, 0.3}, 30));
}

TEST(JointFriction, GrowsWithTheTorqueOfItsOwnLaneAlone) {
  const std::vector<std::vector<double>> z = {{0.1, 1, 0.3, 0.02}, {0.1, 1, 0, 0.02}, {0.2, 1, 0.5, 0.02}};
  const std::vector<int> lanes = {0, 1, 2};
  const auto together = Factory(Folder())->Make(3, 1), alone = Factory(Folder())->Make(1, 1);
  std::vector<double> torques;
  for (const int lane : lanes) {
    together->SetParameters(lane, z[static_cast<size_t>(lane)]);
    ASSERT_TRUE(together->SetStateFromObservation(lane, std::vector<double>{0, 0, 0.7, 0.2}));
    torques.insert(torques.end(), {0.3, 0.1});
  }
  for (int i = 0; i < 5; ++i) together->Step(lanes, torques);
  for (const int lane : lanes) {
    const auto shown = together->observation(lane);
    EXPECT_EQ(std::vector(shown.begin(), shown.end()),
              After(*alone, z[static_cast<size_t>(lane)], {0.7, 0.2}, {0.3, 0.1}, 5))
        << lane;
  }
}

TEST(JointFriction, LeavesNothingBehindInALane) {
  const auto simulator = Factory(Folder())->Make(1, 1);
  const std::vector<double> z = {0.1, 1, 0.3, 0.02};
  const std::vector<double> fresh = After(*simulator, z, {0.4, 0}, {0.1, 0}, 3);
  After(*simulator, {0.9, 5, 1, 0.5}, {8, 1}, {1, 1}, 7);
  EXPECT_EQ(After(*simulator, z, {0.4, 0}, {0.1, 0}, 3), fresh);
}

TEST(JointFriction, DerivativesOfReplaysAreSmooth) {
  const auto simulator = Factory(Folder())->Make(1, 1);
  const auto speed = [&](size_t k, double step) {
    std::vector<double> z = {0.1, 1, 0.3, 0.02};
    z[k] += step;
    return After(*simulator, z, {1.5, 0}, {0.15, 0}, 10)[kWheelSpeed];
  };
  for (const size_t k : {0, 1, 2}) {
    const double wide = (speed(k, 1e-3) - speed(k, -1e-3)) / 2e-3, narrow = (speed(k, 1e-5) - speed(k, -1e-5)) / 2e-5;
    EXPECT_GT(std::abs(narrow), 0.01) << k;
    EXPECT_NEAR(wide / narrow, 1, 1e-3) << k;
  }
}

TEST(JointFriction, TheLanesModelHasMujocosPartOfIt) {
  const auto factory = Factory(Folder());
  const auto simulator = factory->MakeMujoco(1, 1);
  After(*simulator, {0.5, 1, 0.3, 0.04}, {0.1, 0}, {0.2, 0});
  mjModel* model = mj_copyModel(nullptr, &factory->model());
  simulator->CopyModel(0, *model);
  EXPECT_EQ(model->dof_frictionloss[0], 0.04);
  mj_deleteModel(model);
}

TEST(JointFriction, PathsThatNoMjcfHolds) {
  for (const char* path : {"joint/*/stribeck_torque", "joint/a/stribeck_velocity[0]",
                           "joint/a/frictionloss + joint/a/load_friction", "joint/a/load_friction + joint/b/damping"}) {
    EXPECT_TRUE(IsFrictionPath(path)) << path;
  }
  for (const char* path : {"joint/*/frictionloss", "joint/load_friction/damping", "geom/*/friction[0]"}) {
    EXPECT_FALSE(IsFrictionPath(path)) << path;
  }
  const PathInfo info = Factory(Folder())->Describe("joint/cart/stribeck_velocity");
  EXPECT_EQ(info.unit, "m/s");
  EXPECT_EQ(info.places.front().nominal, 0.1);
}

}  // namespace oted::joint_friction_test
