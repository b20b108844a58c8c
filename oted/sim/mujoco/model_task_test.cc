// Task files that are right: they give the numbers of MuJoCo's own Python bindings, keep the contract of a Simulator,
// and describe Hopper as the built-in task does.

#include "oted/sim/mujoco/model_task.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "oted/data/npz.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/mujoco/task.h"
#include "oted/sim/mujoco/testing.h"

namespace oted::model_task_test {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kTolerance = 1e-9;

// A folder with the crawler that lives as long as the program: factories are made from it at any time.
const TestFolder& Shared() {
  static const TestFolder folder;
  return folder;
}

// Steps a simulator of `task` and MuJoCo in Python from the same state with the same actions, and compares each
// observation with the value of `expressions`, and the reward with the last of them.
void ExpectPythonsNumbers(const ModelTask& task, const std::vector<std::string>& expressions, int n_steps,
                          double amplitude = 1) {
  const TestFolder folder;
  const MujocoSimulatorFactory factory(task, {});
  const auto simulator = factory.MakeMujoco(1, 1);
  const SimulatorSpec& spec = factory.spec();
  Rng rng = RngKey(4).MakeRng();
  simulator->Reset(0, rng);
  Array2<double> actions;
  for (int step = 0; step < n_steps; ++step) {
    std::vector<double> action;
    for (int k = 0; k < spec.act_dim; ++k) {
      const auto i = static_cast<size_t>(k);
      action.push_back(amplitude * rng.Uniform(spec.action_low[i], spec.action_high[i]));
    }
    actions.AppendRow(action);
  }
  const std::vector<double> state(simulator->IntegrationState(0).begin(), simulator->IntegrationState(0).end());
  WriteNpz({{"state", NpyArray(state)}, {"actions", NpyArray(actions)}}, folder / "in.npz");
  WriteFileAtomically(folder / "model.mjb", CompileToMjb(task));
  std::string command =
      fmt::format("'{}' '{}/tests/oracle/model_rollouts.py' '{}' {} '{}' '{}'", OTED_TEST_PYTHON, OTED_TEST_SOURCE_DIR,
                  folder / "model.mjb", factory.frame_skip(), folder / "in.npz", folder / "out.npz");
  for (const std::string& expression : expressions) command += fmt::format(" '{}'", expression);
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  const NpyArray values = ReadNpz(folder / "out.npz").at("values");
  const std::vector<double> numbers = values.ToDouble();
  const size_t width = static_cast<size_t>(values.shape[1]), obs_dim = static_cast<size_t>(spec.obs_dim());
  ASSERT_EQ(width, obs_dim + (spec.has_reward ? 1 : 0));
  const int lane = 0;
  double largest = 0, moved = 0;
  for (int step = 0; step <= n_steps; ++step) {
    if (step > 0) simulator->Step({&lane, 1}, actions.row(step - 1));
    ASSERT_NE(simulator->status(0), LaneStatus::kDiverged);
    const double* row = numbers.data() + static_cast<size_t>(step) * width;
    for (size_t i = 0; i < obs_dim; ++i) {
      const double scale = std::max(1.0, std::abs(row[i]));
      EXPECT_NEAR(simulator->observation(0)[i], row[i], kTolerance * scale) << spec.observation_names[i] << " " << step;
      largest = std::max(largest, std::abs(simulator->observation(0)[i] - row[i]));
      moved = std::max(moved, std::abs(row[i] - numbers[i]));
    }
    if (spec.has_reward && step > 0) {
      EXPECT_NEAR(simulator->reward(0), row[obs_dim], kTolerance) << step;
    }
    if (testing::Test::HasFailure()) return;
  }
  EXPECT_GT(moved, 0.01) << "nothing happened";
  fmt::print("{}: {} steps, largest difference {:.3g}\n", spec.task, n_steps, largest);
}

TEST(ModelTask, ObservationsAndRewardAreThoseOfMujocosPythonBindings) {
  ModelTask task = CrawlerTask(Shared());
  task.observations = {
      "joint/*/qpos",       "joint/*/qvel",           "joint/*/qacc",      "joint/hip/qfrc_actuator", "body/*/xpos",
      "body/hand/xquat",    "body/torso/subtree_com", "site/*/xpos",       "site/imu/xquat",          "geom/leg/xpos",
      "geom/leg/xquat[1]",  "actuator/*/force",       "actuator/*/length", "actuator/*/velocity",     "actuator/*/act",
      "tendon/line/length", "tendon/#0/velocity",     "sensor/*"};
  task.unobserved.clear();
  task.terminate.clear();
  ExpectPythonsNumbers(
      task,
      {"d.qpos", "d.qvel", "d.qacc", "d.joint(\"hip\").qfrc_actuator", "d.xpos.ravel()", "d.body(\"hand\").xquat",
       "d.body(\"torso\").subtree_com", "d.site_xpos.ravel()", "d.site_xquat[0]", "d.geom(\"leg\").xpos",
       "d.geom_xquat[4, 1]", "d.actuator_force", "d.actuator_length", "d.actuator_velocity", "d.act", "d.ten_length",
       "d.ten_velocity", "d.sensordata",
       "(lambda v, w: 0.0 if a is None else v + 2 * d.body(\"torso\").xpos[2] - 0.1 * (a ** 2).sum() - 0.01 * abs(w) "
       "+ 0.001 * d.time + a[0] * 0.02)(rate(\"x\", d.body(\"torso\").xpos[0]), rate(\"hip\", "
       "d.joint(\"hip\").qpos[0]))"},
      60);
}

TEST(ModelTask, ObservingMoreDoesNotChangeWhatHappens) {
  ModelTask plain = CrawlerTask(Shared()), rich = plain;
  plain.observations = {"joint/*/qpos", "joint/*/qvel", "actuator/*/act"};
  plain.unobserved.clear();
  plain.reward = plain.terminate = "";
  plain.quantities.clear();
  rich.observations = {"joint/*/qpos", "joint/*/qvel", "actuator/*/act", "sensor/*", "actuator/*/force"};
  rich.unobserved.clear();
  const auto a = MujocoSimulatorFactory(plain, {}).MakeMujoco(1, 1),
             b = MujocoSimulatorFactory(rich, {}).MakeMujoco(1, 1);
  Rng rng_a = RngKey(2).MakeRng(), rng_b = RngKey(2).MakeRng();
  a->Reset(0, rng_a);
  b->Reset(0, rng_b);
  const int lane = 0;
  for (int step = 0; step < 60; ++step) {
    const std::vector<double> action = {std::sin(0.3 * step), std::cos(0.2 * step), 0.1};
    a->Step({&lane, 1}, action);
    b->Step({&lane, 1}, action);
    ASSERT_TRUE(std::ranges::equal(a->IntegrationState(0), b->IntegrationState(0))) << step;
  }
}

TEST(ModelTask, HopperAsATaskFileIsTheBuiltInTask) {
  ModelTask task;
  task.name = "Hopper";
  task.model = (AssetFolder() / "hopper.xml").string();
  task.control_period = 0.008;
  task.observations = {"joint/rootz/qpos", "joint/rooty/qpos", "joint/*_joint/qpos", "joint/*/qvel"};
  task.unobserved = {"joint/rootx/qpos"};
  task.start_noise = 5e-3;
  task.quantities = {{"x", "joint/rootx/qpos"}, {"z", "joint/rootz/qpos"}, {"angle", "joint/rooty/qpos"}};
  task.reward = "d_x + (z > 0.7 && abs(angle) < 0.2) - 1e-3 * sum2_action";
  task.terminate = "z <= 0.7 || abs(angle) >= 0.2";
  const std::vector<ParameterSpec> gain = {{.name = "gain", .field = "actuator/*/gainprm[0]"}};
  const MujocoSimulatorFactory described(task, gain), built_in("Hopper-v5", gain);
  EXPECT_EQ(described.model_sha256(), built_in.model_sha256());
  EXPECT_EQ(described.spec().obs_dim(), built_in.spec().obs_dim());
  EXPECT_EQ(described.spec().control_period_s, built_in.spec().control_period_s);
  EXPECT_TRUE(described.spec().can_set_state);
  const auto a = described.MakeMujoco(1, 1), b = built_in.MakeMujoco(1, 1);
  const int lane = 0;
  int n_terminated = 0;
  for (int episode = 0; episode < 20; ++episode) {
    Rng rng = RngKey(1).Index(static_cast<uint64_t>(episode)).MakeRng();
    a->Reset(0, rng);
    b->SetIntegrationState(0, a->IntegrationState(0));
    a->SetParameters(0, std::vector{0.8});
    b->SetParameters(0, std::vector{0.8});
    for (int step = 0; step < 200 && b->status(0) == LaneStatus::kRunning; ++step) {
      std::vector<double> action(3);
      for (double& u : action) u = rng.Uniform(-1, 1);
      a->Step({&lane, 1}, action);
      b->Step({&lane, 1}, action);
      ASSERT_TRUE(std::ranges::equal(a->IntegrationState(0), b->IntegrationState(0)));
      ASSERT_NEAR(a->reward(0), b->reward(0), 1e-12);
      ASSERT_EQ(a->status(0), b->status(0));
    }
    n_terminated += b->status(0) == LaneStatus::kTerminated;
  }
  EXPECT_EQ(n_terminated, 20) << "the end was never compared";
}

TEST(ModelTask, NamesUnitsAndBoundsStandInTheSpec) {
  const MujocoSimulatorFactory factory(CrawlerTask(Shared()), {});
  const SimulatorSpec& spec = factory.spec();
  EXPECT_EQ(spec.task, "Crawler");
  EXPECT_EQ(spec.observation_names[0], "joint/root/qpos[2]");
  EXPECT_EQ(spec.observation_names[8], "joint/neck/qpos[3]");
  EXPECT_EQ(spec.observation_names[10], "joint/extend/qpos");
  EXPECT_EQ(spec.observation_names[11], "sensor/hip_angle") << "a sensor keeps its own name";
  EXPECT_EQ(static_cast<int>(spec.observation_names.size()), spec.obs_dim());
  EXPECT_EQ(spec.observation_units.size(), spec.observation_names.size());
  EXPECT_EQ(spec.observation_units[10], "m");
  EXPECT_EQ(spec.observation_units[11], "rad");
  EXPECT_THAT(spec.action_names, ElementsAre("actuator/hip", "actuator/wrist", "actuator/line"));
  EXPECT_THAT(spec.action_low, ElementsAre(-1, -2, -0.2));
  EXPECT_THAT(spec.action_high, ElementsAre(1, 1, 0.2));
  EXPECT_DOUBLE_EQ(spec.control_period_s, 0.02);
  EXPECT_EQ(factory.frame_skip(), 5);
}

TEST(ModelTask, AStateThatIsSeenButForItsPlaceOnTheFloorCanBeSet) {
  const MujocoSimulatorFactory factory(CrawlerTask(Shared()), {});
  EXPECT_TRUE(factory.spec().can_set_state);
  EXPECT_EQ(factory.why_not_settable(), "");
  const auto from = factory.MakeMujoco(1, 1), to = factory.MakeMujoco(1, 1);
  Rng rng = RngKey(3).MakeRng();
  from->Reset(0, rng);
  const int lane = 0;
  for (int step = 0; step < 10; ++step) from->Step({&lane, 1}, std::vector{0.5, -0.5, 0.1});
  ASSERT_TRUE(to->SetStateFromObservation(0, from->observation(0)));
  for (size_t i = 2; i < from->qpos(0).size(); ++i) EXPECT_NEAR(to->qpos(0)[i], from->qpos(0)[i], 1e-15);
  EXPECT_TRUE(std::ranges::equal(to->qvel(0), from->qvel(0)));
  EXPECT_EQ(to->qpos(0)[0], 0);
  from->Step({&lane, 1}, std::vector{0.5, -0.5, 0.1});
  to->Step({&lane, 1}, std::vector{0.5, -0.5, 0.1});
  for (int i = 0; i < factory.spec().obs_dim(); ++i) {
    // The solver's warm start is not observed.
    EXPECT_NEAR(to->observation(0)[static_cast<size_t>(i)], from->observation(0)[static_cast<size_t>(i)], 1e-5);
  }
}

TEST(ModelTask, AStateOfWhichPositionsAreSeenIsSetWithTheVelocitiesBeside) {
  ModelTask task = CrawlerTask(Shared());
  std::erase_if(task.observations, [](const std::string& path) { return path.ends_with("/qvel"); });
  ASSERT_LT(task.observations.size(), CrawlerTask(Shared()).observations.size());
  const MujocoSimulatorFactory factory(task, {});
  EXPECT_FALSE(factory.spec().can_set_state);
  ASSERT_TRUE(factory.spec().can_replay());
  const auto simulator = factory.MakeMujoco(1, 1);
  std::vector<double> state(static_cast<size_t>(factory.spec().state_dim()));
  for (size_t i = 0; i < state.size(); ++i) state[i] = 0.3 + 0.01 * static_cast<double>(i);
  ASSERT_TRUE(simulator->SetState(0, state, {}));
  const size_t obs_dim = static_cast<size_t>(factory.spec().obs_dim());
  for (size_t k = 0; k < factory.spec().hidden.size(); ++k) {
    const auto& values = simulator->qvel(0);
    EXPECT_TRUE(std::ranges::count(values, state[obs_dim + k]) == 1) << factory.spec().hidden[k].name;
  }
  EXPECT_THROW(simulator->SetState(0, std::vector<double>(obs_dim), {}), UsageError);
  EXPECT_THROW(simulator->SetStateFromObservation(0, std::vector<double>(obs_dim)), UsageError);
}

TEST(ModelTask, WithoutAPositionNoStateIsGuessed) {
  ModelTask task = CrawlerTask(Shared());
  std::erase_if(task.observations, [](const std::string& path) { return path.ends_with("/qpos"); });
  EXPECT_FALSE(MujocoSimulatorFactory(task, {}).spec().can_replay());
}

TEST(ModelTask, AQuaternionOfZerosDeterminesNoState) {
  const MujocoSimulatorFactory factory(CrawlerTask(Shared()), {});
  const auto simulator = factory.MakeMujoco(1, 1);
  std::vector<double> observation(simulator->observation(0).begin(), simulator->observation(0).end());
  std::fill(observation.begin() + 1, observation.begin() + 5, 0.0);
  EXPECT_FALSE(simulator->SetStateFromObservation(0, observation));
}

TEST(ModelTask, TellsWhatKeepsAStateFromBeingSet) {
  const MujocoSimulatorFactory factory(BlindCrawlerTask(Shared()), {});
  EXPECT_FALSE(factory.spec().can_set_state);
  EXPECT_FALSE(factory.spec().has_reward);
  EXPECT_THAT(factory.why_not_settable(), HasSubstr("joint/root/qpos[0]"));
  ModelTask task = CrawlerTask(Shared());
  std::erase(task.observations, "actuator/*/act");
  EXPECT_EQ(MujocoSimulatorFactory(task, {}).why_not_settable(), "") << "it follows the commands";
  std::erase(task.observations, "joint/wrist/qpos");
  EXPECT_THAT(MujocoSimulatorFactory(task, {}).why_not_settable(), HasSubstr("no observation shows joint/wrist/qpos"));
}

TEST(ModelTask, LoggedPositionsAloneAreAStartAtRest) {
  ModelTask task = CrawlerTask(Shared());
  std::erase(task.observations, "joint/*/qvel");
  std::erase(task.observations, "sensor/gyro");
  task.start = "default";
  task.start_noise = 0;
  const MujocoSimulatorFactory nominal(task, {});
  task.start = "logs";
  const auto moving = nominal.MakeMujoco(1, 1);
  Rng rng = RngKey(3).MakeRng();
  moving->Reset(0, rng);
  const int lane = 0;
  for (int step = 0; step < 5; ++step) moving->Step({&lane, 1}, std::vector{0.5, -0.5, 0.1});
  Array2<double> starts;
  starts.AppendRow(moving->observation(0));
  const auto simulator = MujocoSimulatorFactory(task, {}, starts).MakeMujoco(1, 1);
  simulator->Reset(0, rng);
  const std::vector<double> shown(simulator->observation(0).begin(), simulator->observation(0).end());
  ASSERT_EQ(shown.size(), starts.row(0).size());
  for (size_t i = 0; i < shown.size(); ++i) EXPECT_NEAR(shown[i], starts(0, static_cast<int>(i)), 1e-9) << i;
  EXPECT_TRUE(std::ranges::all_of(simulator->qvel(0), [](double v) { return v == 0; }));
}

TEST(ModelTask, StartsAreTheKeyframesWithUniformNoiseOnEveryCoordinate) {
  ModelTask task = CrawlerTask(Shared());
  task.start_noise = 0.1;
  const auto simulator = MujocoSimulatorFactory(task, {}).MakeMujoco(1, 1);
  Rng rng = RngKey(5).MakeRng();
  double low = 1, high = -1, norm_error = 0;
  for (int i = 0; i < 2000; ++i) {
    simulator->Reset(0, rng);
    const auto q = simulator->qpos(0);
    low = std::min(low, q[2] - 0.35);
    high = std::max(high, q[2] - 0.35);
    norm_error = std::max(norm_error, std::abs(q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6] - 1));
    for (const double v : simulator->qvel(0)) ASSERT_LE(std::abs(v), 0.1);
    // Rotation vectors within a cube of half width 0.1 turn by at most 0.1 sqrt(3).
    ASSERT_LE(2 * std::acos(std::min(1.0, std::abs(q[3]))), 0.1 * std::sqrt(3.0) + 1e-6);
  }
  EXPECT_NEAR(low, -0.1, 1e-3);
  EXPECT_NEAR(high, 0.1, 1e-3);
  EXPECT_LT(norm_error, 1e-12);
}

TEST(ModelTask, PositionsOfTheStartMayBeGiven) {
  ModelTask task = CrawlerTask(Shared());
  task.start = "default";
  task.start_noise = 0;
  task.start_qpos = {1, 2, 0.5, 2, 0, 0, 0, 1, 0, 0, 0, 0.1, 0.05, -0.2};
  const auto simulator = MujocoSimulatorFactory(task, {}).MakeMujoco(1, 1);
  Rng rng = RngKey(5).MakeRng();
  simulator->Reset(0, rng);
  const std::vector<double> q(simulator->qpos(0).begin(), simulator->qpos(0).end());
  EXPECT_THAT(q, ElementsAre(1, 2, 0.5, 1, 0, 0, 0, 1, 0, 0, 0, 0.1, 0.05, -0.2)) << "the quaternion is normalised";
}

TEST(ModelTask, StartsFromLogsAreLoggedStarts) {
  ModelTask task = CrawlerTask(Shared());
  const MujocoSimulatorFactory source(task, {});
  const auto logging = source.MakeMujoco(1, 1);
  Array2<double> starts;
  Rng rng = RngKey(6).MakeRng();
  for (int i = 0; i < 3; ++i) {
    logging->Reset(0, rng);
    starts.AppendRow(logging->observation(0));
  }
  task.start = "logs";
  task.start_noise = 0;
  const auto simulator = MujocoSimulatorFactory(task, {}, starts).MakeMujoco(1, 1);
  std::vector<int> counts(3, 0);
  for (int i = 0; i < 60; ++i) {
    simulator->Reset(0, rng);
    for (int k = 0; k < 3; ++k) counts[static_cast<size_t>(k)] += simulator->observation(0)[0] == starts(k, 0);
  }
  EXPECT_EQ(counts[0] + counts[1] + counts[2], 60);
  EXPECT_GT(*std::min_element(counts.begin(), counts.end()), 5);
}

TEST(ModelTask, ActionsReachTheirActuatorsAndTheOthersStayAsAtTheStart) {
  ModelTask task = CrawlerTask(Shared());
  task.actions = {"actuator/line", "actuator/hip"};
  task.reward = task.terminate = "";
  task.observations = {"actuator/*/force", "joint/hip/qpos"};
  task.unobserved.clear();
  const MujocoSimulatorFactory factory(task, {});
  EXPECT_THAT(factory.spec().action_names, ElementsAre("actuator/line", "actuator/hip"));
  EXPECT_THAT(factory.spec().action_low, ElementsAre(-0.2, -1));
  const auto simulator = factory.MakeMujoco(1, 1);
  const int lane = 0;
  simulator->Step({&lane, 1}, std::vector{0.1, 0.7});
  EXPECT_NEAR(simulator->observation(0)[0], 0.7, 1e-12) << "the hip's motor, second in the list of actions";
}

TEST(ModelTask, AnExplodingLaneIsDivergedAlsoWhereSensorsAreObserved) {
  ModelTask task = CrawlerTask(Shared());
  task.observations = {"joint/*/qpos", "joint/*/qvel", "sensor/*"};
  task.unobserved.clear();
  const auto simulator = MujocoSimulatorFactory(task, {}).MakeMujoco(2, 1);
  std::vector<double> state(simulator->IntegrationState(1).begin(), simulator->IntegrationState(1).end());
  state[static_cast<size_t>(simulator->qvel(1).data() - simulator->IntegrationState(1).data())] = 1e12;
  simulator->SetIntegrationState(1, state);
  const std::vector<int> lanes = {0, 1};
  simulator->Step(lanes, std::vector(6, 0.0));
  EXPECT_EQ(simulator->status(1), LaneStatus::kDiverged);
  EXPECT_EQ(simulator->reward(1), 0);
  EXPECT_EQ(simulator->status(0), LaneStatus::kRunning);
  for (const double v : simulator->observation(1)) EXPECT_TRUE(std::isfinite(v));
}

TEST(ModelTask, AUrdfWithMotorsOnItsJointsMovesAsInPython) {
  const TestFolder folder;
  WriteFileAtomically(folder / "arm.urdf", R"(<robot name="arm">
    <link name="base"/>
    <link name="upper"><inertial><origin xyz="0 0 -0.2"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="lower"><inertial><origin xyz="0 0 -0.15"/><mass value="0.5"/>
      <inertia ixx="0.005" iyy="0.005" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
      <limit effort="6" velocity="10"/></joint>
    <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 -0.4"/>
      <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="3" velocity="10"/></joint>
  </robot>)");
  ModelTask task;
  task.name = "Urdf";
  task.model = folder / "arm.urdf";
  task.motors = {"joint/*"};
  task.control_period = 0.02;
  task.start_noise = 0.1;
  const MujocoSimulatorFactory factory(task, {{.name = "gain", .field = "actuator/elbow/gainprm[0]"}});
  EXPECT_THAT(factory.spec().action_names, ElementsAre("actuator/shoulder", "actuator/elbow"));
  EXPECT_THAT(factory.spec().action_high, ElementsAre(6, 3)) << "the effort limits";
  ExpectPythonsNumbers(task, {"d.qpos", "d.qvel"}, 50);
}

// Robots that people use, read from the dm_control wheel (requirements-models.txt; make setup installs it).
TEST(ModelTask, TheWalkerOfDmControlIsThatOfPython) {
  ModelTask task;
  task.name = "DmWalker";
  task.model = "package:dm_control/suite/walker.xml";
  task.control_period = 0.025;
  task.observations = {"joint/*/qpos", "joint/*/qvel", "sensor/torso_subtreelinvel", "body/torso/xpos[2]"};
  task.start_noise = 0.02;
  task.quantities = {{"z", "body/torso/xpos[2]"}, {"foot", "geom/left_foot/xpos"}};
  task.reward = "z + foot[0] - 0.01 * sum2_action";
  ExpectPythonsNumbers(task,
                       {"d.qpos", "d.qvel", "d.sensordata", "d.xpos[1, 2]",
                        "0.0 if a is None else d.xpos[1, 2] + d.geom(\"left_foot\").xpos[0] - 0.01 * (a ** 2).sum()"},
                       80);
}

TEST(ModelTask, TheJacoArmOfDmControlIsThatOfPython) {
  ModelTask task;
  task.name = "Jaco";
  task.model = "package:dm_control/third_party/kinova/jaco_arm.xml";
  task.motors = {"joint/*"};
  task.action_range = {-30, 30};
  task.control_period = 0.02;
  task.start_qpos = {0, 3.1, 3.1, 0, 0, 0};
  task.start_noise = 0.1;
  task.observations = {"joint/*/qpos", "joint/*/qvel", "site/wristsite/xpos"};
  ExpectPythonsNumbers(task, {"d.qpos", "d.qvel", "d.site_xpos[0]"}, 50, 0.5);
}

}  // namespace oted::model_task_test
