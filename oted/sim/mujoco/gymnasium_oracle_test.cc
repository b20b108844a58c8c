// The truth is Gymnasium itself: tests/oracle/gymnasium_rollouts.py records its rollouts, and a simulator that starts
// in the same integration state and takes the same actions must give the same numbers.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "oted/data/npz.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/mujoco/task.h"

namespace oted::gymnasium_oracle_test {

constexpr double kTolerance = 1e-9;

// The shipped expert of a task; v4 and v5 have the same observations.
std::string PolicyOf(const std::string& task) {
  std::string name = task.substr(0, task.find('-'));
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  return fmt::format("{}/examples/policies/{}/expert.npz", OTED_TEST_SOURCE_DIR, name);
}

// Gymnasium's rollouts of a task. `options`: "--scale friction=0.6" changes the model, "--policy FILE" chooses actions.
NpzArrays RecordGymnasium(const std::string& task, const std::string& options) {
  const std::filesystem::path out =
      std::filesystem::path(testing::TempDir()) / fmt::format("oracle_{}_{}.npz", task, getpid());
  const std::string command = fmt::format("'{}' '{}/tests/oracle/gymnasium_rollouts.py' {} '{}' {}", OTED_TEST_PYTHON,
                                          OTED_TEST_SOURCE_DIR, task, out.string(), options);
  // HalfCheetah's deprecation warnings of both packages are not of interest here.
  EXPECT_EQ(std::system((command + " 2>/dev/null").c_str()), 0) << command;
  NpzArrays arrays = ReadNpz(out);
  std::filesystem::remove(out);
  return arrays;
}

struct Differences {
  double observation = 0;
  double reward = 0;
  int terminations = 0;
  int truncations = 0;
  int n_terminated = 0;
  int n_truncated = 0;
  int n_steps = 0;
  double first_return = 0;  // of the episode that ignores termination
};

// Replays every recorded episode.
Differences Replay(const NpzArrays& recorded, const MujocoSimulatorFactory& factory, std::span<const double> z) {
  const auto array = [&](const char* name) { return recorded.at(name).ToDouble(); };
  const std::vector<double> states = array("states"), lengths = array("lengths"), actions = array("actions"),
                            observations = array("observations"), rewards = array("rewards"),
                            terminals = array("terminals");
  const std::unique_ptr<MujocoSimulator> simulator = factory.MakeMujoco(1, 1);
  simulator->SetParameters(0, z);
  const size_t n_state = states.size() / lengths.size();
  const size_t act_dim = static_cast<size_t>(factory.spec().act_dim);
  const size_t obs_dim = static_cast<size_t>(factory.spec().obs_dim());
  const int lane = 0;
  Differences worst;
  size_t row = 0;
  for (size_t episode = 0; episode < lengths.size(); ++episode) {
    simulator->SetIntegrationState(lane, std::span(states).subspan(episode * n_state, n_state));
    for (int step = 1; step <= static_cast<int>(lengths[episode]); ++step, ++row) {
      simulator->Step({&lane, 1}, std::span(actions).subspan(row * act_dim, act_dim));
      for (size_t i = 0; i < obs_dim; ++i) {
        const double difference = std::abs(simulator->observation(lane)[i] - observations[row * obs_dim + i]);
        worst.observation = std::max(worst.observation, std::isnan(difference) ? HUGE_VAL : difference);
      }
      worst.reward = std::max(worst.reward, std::abs(simulator->reward(lane) - rewards[row]));
      const bool terminated = terminals[row] != 0;
      worst.terminations += terminated != (simulator->status(lane) == LaneStatus::kTerminated);
      worst.truncations += (step == 1000 && !terminated) != (simulator->status(lane) == LaneStatus::kTruncated);
      // The first episode goes on after its terminal states.
      worst.n_terminated += episode > 0 && terminated;
      worst.n_truncated += episode > 0 && step == 1000 && !terminated;
      worst.first_return += episode == 0 ? rewards[row] : 0;
      ++worst.n_steps;
    }
  }
  EXPECT_EQ(row, rewards.size());
  return worst;
}

void ExpectEqual(const std::string& task, const Differences& d) {
  fmt::print("{}: {} steps, {} falls, {} time limits; largest difference: observation {:.3g}, reward {:.3g}\n", task,
             d.n_steps, d.n_terminated, d.n_truncated, d.observation, d.reward);
  EXPECT_LE(d.observation, kTolerance);
  EXPECT_LE(d.reward, kTolerance);
  EXPECT_EQ(d.terminations, 0);
  EXPECT_EQ(d.truncations, 0);
  EXPECT_GT(d.n_steps, 2000);
}

class GymnasiumOracle : public testing::TestWithParam<std::string> {
 protected:
  // Whether the task ends when the robot falls.
  bool can_fall() const { return !GetParam().starts_with("HalfCheetah"); }
};

TEST_P(GymnasiumOracle, NominalRolloutsOfRandomActionsAreGymnasiumsAndAWrongParameterIsTold) {
  const NpzArrays recorded = RecordGymnasium(GetParam(), "");
  const Differences d = Replay(recorded, MujocoSimulatorFactory(GetParam(), {}), {});
  ExpectEqual(GetParam(), d);
  // Random actions throw the two that can fall in all of the 100 episodes.
  EXPECT_EQ(d.n_terminated, can_fall() ? 100 : 0);

  const MujocoSimulatorFactory wrong(GetParam(), {{.name = "gain", .field = "actuator/*/gainprm[0]"}});
  EXPECT_GT(Replay(recorded, wrong, std::vector{1.001}).observation, 1e-6);
}

TEST_P(GymnasiumOracle, NominalRolloutsOfATrainedPolicyAreGymnasiums) {
  const MujocoSimulatorFactory factory(GetParam(), {});
  const Differences d = Replay(
      RecordGymnasium(GetParam(), fmt::format("--episodes 50 --policy '{}'", PolicyOf(GetParam()))), factory, {});
  ExpectEqual(GetParam(), d);
  // The policy goes where random actions never get, and with noise it falls from there.
  if (can_fall()) {
    EXPECT_GT(d.n_steps, 10'000);
    EXPECT_GE(d.n_terminated, 25);
  } else {
    EXPECT_GT(d.first_return, 1000);
  }
  // Walker2d's expert seldom lasts to the time limit.
  if (!GetParam().starts_with("Walker2d")) {
    EXPECT_GE(d.n_truncated, 1);
  }
}

TEST_P(GymnasiumOracle, RolloutsWithScaledFieldsAreThoseOfAModifiedGymnasiumModel) {
  const MujocoSimulatorFactory factory(GetParam(), {{.name = "friction", .field = "geom/*/friction[0]"},
                                                    {.name = "gain", .field = "actuator/*/gainprm[0]"},
                                                    {.name = "gravity", .field = "opt/gravity[2]"}});
  const NpzArrays recorded = RecordGymnasium(GetParam(), "--scale friction=0.6 --scale gain=1.3 --scale gravity=1.2");
  const Differences d = Replay(recorded, factory, std::vector{0.6, 1.3, 1.2});
  ExpectEqual(GetParam(), d);
  EXPECT_EQ(d.n_terminated, can_fall() ? 100 : 0);
}

// Gymnasium has no v2: legacy_inertia_test.cc.
std::vector<std::string> GymnasiumTasks() {
  std::vector<std::string> names = TaskNames();
  std::erase_if(names, [](const std::string& name) { return name.ends_with("-v2"); });
  return names;
}

INSTANTIATE_TEST_SUITE_P(EveryTask, GymnasiumOracle, testing::ValuesIn(GymnasiumTasks()), [](const auto& parameter) {
  std::string name = parameter.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace oted::gymnasium_oracle_test
