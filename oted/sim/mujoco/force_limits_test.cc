// Limits of forces that a model lacks: how large none is reached, and what a drive does under one, in closed form.

#include "oted/sim/mujoco/force_limits.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"

namespace oted::force_limits_test {

using testing::HasSubstr;

constexpr double kInertia = 0.02, kStep = 0.001, kGear = 2;

/// Wheels about vertical axes: one with a motor, others with servos, a limited drive, a muscle and one of no range.
constexpr const char* kXml = R"(<mujoco><compiler angle="radian"/>
  <option timestep="0.001" integrator="Euler" gravity="0 0 0"/>
  <default><geom type="sphere" size="0.1" mass="0" contype="0" conaffinity="0"/></default>
  <worldbody>
    <body><joint name="wheel" axis="0 0 1"/><inertial pos="0 0 0" mass="1" diaginertia="0.02 0.02 0.02"/></body>
    <body><joint name="arm" axis="0 0 1" range="-2 1.5"/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  </worldbody>
  <actuator>
    <motor name="motor" joint="wheel" gear="2" ctrlrange="-1 3"/>
    <position name="servo" joint="arm" kp="10" kv="1" ctrlrange="-1 1"/>
    <velocity name="spin" joint="arm" kv="4" ctrlrange="-5 5"/>
    <motor name="limited" joint="arm" ctrlrange="-1 1" forcerange="-0.5 0.5"/>
    <muscle name="muscle" joint="arm" lengthrange="0 1"/>
    <motor name="free" joint="arm"/>
  </actuator>
</mujoco>)";

struct Wheels {
  TestFolder folder;
  ModelTask task;

  Wheels() {
    WriteFileAtomically(folder / "wheels.xml", kXml);
    task.name = "Wheels";
    task.model = folder / "wheels.xml";
    task.control_period = 0.02;
    task.actions = {"actuator/motor"};
    task.observations = {"joint/*/qpos", "joint/*/qvel"};
    task.unobserved = {"actuator/muscle/act"};
    task.max_episode_steps = 1000;
  }
  MujocoSimulatorFactory Limited(double high = 1000) const {
    return {task,
            {{.name = "limit",
              .field = "actuator/motor/force_limit",
              .low = 0.01,
              .high = high,
              .scale = ParameterScale::kAbsolute}}};
  }
};

/// The wheel's angle and speed after ten control periods at a control of 2, from rest.
std::vector<double> Turned(const SimulatorFactory& factory, const std::vector<double>& z) {
  const auto simulator = factory.Make(1, 1);
  simulator->SetParameters(0, z);
  Rng rng(1);
  simulator->ResetTo(0, std::vector<double>(2, 0.0), std::vector<double>(2, 0.0), rng);
  const int lane = 0;
  for (int i = 0; i < 10; ++i) simulator->Step({&lane, 1}, std::vector<double>{2.0});
  return {simulator->observation(0)[0], simulator->observation(0)[2]};
}

TEST(UnreachedForce, IsFarBeyondWhatRangesOfControlAndJointAllow) {
  const Wheels wheels;
  const MujocoSimulatorFactory factory(wheels.task, {});
  const auto of = [&](int actuator) { return UnreachedForce(factory.model(), actuator); };
  EXPECT_DOUBLE_EQ(of(0), 100 * 3) << "before the gear";
  EXPECT_DOUBLE_EQ(of(1), 100 * (10 * 1 + 10 * 2)) << "at one end of its control, at the other of its joint";
  EXPECT_DOUBLE_EQ(of(2), 100 * (4 * 5 + 4 * 5)) << "told to turn back";
  EXPECT_EQ(of(3), 0) << "it has a limit";
  EXPECT_EQ(of(4), 0) << "a muscle";
  EXPECT_EQ(of(5), 0) << "no range of its control";
}

TEST(LetForcesBeLimited, LeavesTheNominalModelAsItIs) {
  const Wheels wheels;
  const MujocoSimulatorFactory plain(wheels.task, {}), limited = wheels.Limited();
  EXPECT_EQ(limited.parameters()[0].nominal, 300);
  EXPECT_EQ(limited.parameters()[0].unit, "N m");
  EXPECT_EQ(Turned(limited, {300}), Turned(plain, {})) << "to the last bit";
  EXPECT_EQ(limited.model_sha256(), plain.model_sha256());
}

TEST(LetForcesBeLimited, TakesTheTopOfARangeThatEndsBelow) {
  const Wheels wheels;
  EXPECT_EQ(wheels.Limited(30).parameters()[0].nominal, 30);
}

TEST(LetForcesBeLimited, ADriveOfUnknownForceIsRefused) {
  const Wheels wheels;
  const std::string message = MessageOf<UsageError>([&] {
    MujocoSimulatorFactory(wheels.task, {{.name = "limit",
                                          .field = "actuator/free/force_limit",
                                          .low = 0,
                                          .high = 9,
                                          .scale = ParameterScale::kAbsolute}});
  });
  EXPECT_THAT(message, HasSubstr("actuator 'free' has no force limit"));
}

TEST(LetForcesBeLimited, LetsADriveSaturate) {
  const Wheels wheels;
  constexpr double kForce = 0.6;  // 2 N m are asked for
  double angle = 0, speed = 0;
  for (int i = 0; i < 200; ++i) {  // MuJoCo's semi-implicit Euler
    speed += kStep * kGear * kForce / kInertia;
    angle += kStep * speed;
  }
  const std::vector<double> turned = Turned(wheels.Limited(), {kForce});
  EXPECT_NEAR(turned[0], angle, 1e-9 * angle);
  EXPECT_NEAR(turned[1], speed, 1e-9 * speed);
}

TEST(LetForcesBeLimited, IsInTheExportedModel) {
  const Wheels wheels;
  const std::string mjcf = wheels.Limited().Mjcf(std::vector<double>{0.6}, "limited", {});
  EXPECT_THAT(mjcf, HasSubstr(R"(joint="wheel" ctrlrange="-1 3" forcelimited="true" forcerange="-0.6 0.6")"));
}

}  // namespace oted::force_limits_test
