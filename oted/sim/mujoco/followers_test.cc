#include "oted/sim/mujoco/followers.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"

namespace oted::followers_test {

/// A driven joint; one bent behind it, one that a line ties to that, one that is held, and one by itself whose tie is
/// not active. Stiff ties, as positions are compared with what the constraints make of them.
std::filesystem::path WriteHand(const TestFolder& folder) {
  const auto finger = [](const std::string& name, double reference) {
    return "<body pos='0 1 0'><joint name='" + name + "' type='hinge' axis='1 0 0' ref='" + std::to_string(reference) +
           "' damping='0.05'/><geom type='capsule' fromto='0 0 0 0 0 -0.1' size='0.01'/></body>";
  };
  WriteFileAtomically(folder / "hand.xml",
                      "<mujoco><compiler angle='radian'/><option timestep='0.002' gravity='0 0 0'/><worldbody>" +
                          finger("driven", 0.2) + finger("bent", -0.1) + finger("line", 0) + finger("held", 0.3) +
                          finger("free", 0) + R"(</worldbody><equality>
    <joint joint1='line' joint2='bent' polycoef='0.05 -2 0 0 0' solref='0.004 1'/>
    <joint joint1='bent' joint2='driven' polycoef='0.1 -0.5 0.3 0.1 0' solref='0.004 1'/>
    <joint joint1='held' polycoef='0.15 0 0 0 0' solref='0.004 1'/>
    <joint joint1='free' joint2='driven' active='false'/>
  </equality><actuator><motor joint='driven' ctrlrange='-1 1' gear='0.2'/></actuator></mujoco>)");
  return folder / "hand.xml";
}

int Qpos(const mjModel& model, const char* joint) { return model.jnt_qposadr[mj_name2id(&model, mjOBJ_JOINT, joint)]; }

TEST(Followers, AreWhereTheConstraintsPutThem) {
  const TestFolder folder;
  const LoadedModel loaded = LoadModel(WriteHand(folder));
  const mjModel& model = *loaded.model;
  const DataPtr data(mj_makeData(&model));
  data->ctrl[0] = 0.4;
  for (int step = 0; step < 150; ++step) mj_step(&model, data.get());
  const int driven = Qpos(model, "driven");
  const double speed = std::abs(data->qvel[model.jnt_dofadr[0]]);
  for (const char* seen : {"driven", "line"}) {
    const std::vector<Follower> followers =
        FollowersOf(model, [&](int qpos) { return qpos == Qpos(model, seen) || qpos == Qpos(model, "free"); });
    // From the line's end the bent one is known, but a cube has no inverse.
    ASSERT_EQ(followers.size(), seen == std::string("driven") ? 3 : 2) << seen;
    const DataPtr followed(mj_copyData(nullptr, &model, data.get()));
    for (const Follower& follower : followers) {
      followed->qpos[follower.qpos] = followed->qvel[follower.dof] = 9;
    }
    const LaneState state{
        {followed->qpos, static_cast<size_t>(model.nq)}, {followed->qvel, static_cast<size_t>(model.nv)}, {}};
    for (const Follower& follower : followers) Follow(follower, state);
    for (int i = 0; i < model.nq; ++i) {
      EXPECT_NEAR(followed->qpos[i], data->qpos[i], 5e-3) << i << " behind " << seen;
      EXPECT_NEAR(followed->qvel[i], data->qvel[i], 0.05 * speed) << i << " behind " << seen;
    }
  }
  EXPECT_GT(std::abs(data->qpos[driven] - model.qpos0[driven]), 0.1) << "else it tests nothing";
  EXPECT_GT(speed, 0.5);
}

TEST(Followers, NeedNotBeObservedForAStateToBeSet) {
  const TestFolder folder;
  ModelTask task;
  task.name = "hand";
  task.model = WriteHand(folder).string();
  task.control_period = 0.01;
  task.observations = {"joint/driven/qpos", "joint/driven/qvel", "joint/free/qpos", "joint/free/qvel"};
  task.actions = {"actuator/*"};
  const MujocoSimulatorFactory some(task, {});
  EXPECT_EQ(some.why_not_settable(), "");
  const auto simulator = some.MakeMujoco(1, 1);
  ASSERT_TRUE(simulator->SetStateFromObservation(0, std::vector{0.5, 2.0, 0.1, 0.0}));
  const mjModel& model = some.model();
  const double moved = 0.5 - 0.2;
  const double bent = 0.1 - 0.5 * moved + 0.3 * moved * moved + 0.1 * moved * moved * moved;
  EXPECT_NEAR(simulator->qpos(0)[static_cast<size_t>(Qpos(model, "bent"))], -0.1 + bent, 1e-12);
  EXPECT_NEAR(simulator->qvel(0)[1], (-0.5 + 0.6 * moved + 0.3 * moved * moved) * 2.0, 1e-12);
  EXPECT_NEAR(simulator->qpos(0)[static_cast<size_t>(Qpos(model, "line"))], 0.05 - 2 * bent, 1e-12);
  EXPECT_NEAR(simulator->qpos(0)[static_cast<size_t>(Qpos(model, "held"))], 0.3 + 0.15, 1e-12);
  // Without velocities they follow those that the fit finds; one that nothing ties is missing.
  task.observations = {"joint/driven/qpos", "joint/free/qpos"};
  const MujocoSimulatorFactory positions(task, {});
  ASSERT_TRUE(positions.spec().can_replay());
  EXPECT_EQ(positions.spec().hidden.size(), 2);
  const auto beside = positions.MakeMujoco(1, 1);
  ASSERT_TRUE(beside->SetState(0, std::vector{0.5, 0.1, 2.0, 0.0}, {}));
  EXPECT_NEAR(beside->qvel(0)[1], simulator->qvel(0)[1], 1e-12);
  task.observations = {"joint/driven/qpos"};
  EXPECT_THAT(MujocoSimulatorFactory(task, {}).why_not_settable(),
              testing::HasSubstr("no observation shows joint/free/qpos"));
}

}  // namespace oted::followers_test
