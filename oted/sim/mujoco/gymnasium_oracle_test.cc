// The truth is Gymnasium itself: tests/oracle/gymnasium_rollouts.py records its rollouts, and a simulator that starts
// in the same integration state and takes the same actions must give the same numbers.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "oted/data/npz.h"
#include "oted/sim/mujoco/mujoco_simulator.h"
#include "oted/sim/mujoco/task.h"

namespace oted {
namespace {

constexpr double kTolerance = 1e-9;

// Gymnasium's rollouts of a task, with the model changed as `scales` says ("friction=0.6").
NpzArrays RecordGymnasium(const std::string& task, const std::vector<std::string>& scales) {
  const std::filesystem::path out =
      std::filesystem::path(testing::TempDir()) / fmt::format("oracle_{}_{}_{}.npz", task, scales.size(), getpid());
  std::string command = fmt::format("'{}' '{}/tests/oracle/gymnasium_rollouts.py' {} '{}'", OTED_TEST_PYTHON,
                                    OTED_TEST_SOURCE_DIR, task, out.string());
  for (const std::string& scale : scales) command += " --scale " + scale;
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
  int n_steps = 0;
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
      worst.n_terminated += terminated;
      ++worst.n_steps;
    }
  }
  EXPECT_EQ(row, rewards.size());
  return worst;
}

void ExpectEqual(const std::string& task, const Differences& d) {
  fmt::print("{}: {} steps, {} terminal; largest difference: observation {:.3g}, reward {:.3g}, termination {}\n", task,
             d.n_steps, d.n_terminated, d.observation, d.reward, d.terminations);
  EXPECT_LE(d.observation, kTolerance);
  EXPECT_LE(d.reward, kTolerance);
  EXPECT_EQ(d.terminations, 0);
  EXPECT_EQ(d.truncations, 0);
  EXPECT_GT(d.n_steps, 2000);
  // Random actions throw the two that can fall in all of the 100 episodes.
  EXPECT_EQ(d.n_terminated >= 100, !task.starts_with("HalfCheetah"));
}

class GymnasiumOracle : public testing::TestWithParam<std::string> {};

TEST_P(GymnasiumOracle, NominalRolloutsAreGymnasiums) {
  const MujocoSimulatorFactory factory(GetParam(), {});
  ExpectEqual(GetParam(), Replay(RecordGymnasium(GetParam(), {}), factory, {}));
}

TEST_P(GymnasiumOracle, RolloutsWithScaledFieldsAreThoseOfAModifiedGymnasiumModel) {
  const MujocoSimulatorFactory factory(GetParam(), {{.name = "friction", .field = "geom/*/friction[0]"},
                                                    {.name = "gain", .field = "actuator/*/gainprm[0]"},
                                                    {.name = "gravity", .field = "opt/gravity[2]"}});
  const NpzArrays recorded = RecordGymnasium(GetParam(), {"friction=0.6", "gain=1.3", "gravity=1.2"});
  ExpectEqual(GetParam(), Replay(recorded, factory, std::vector{0.6, 1.3, 1.2}));
}

TEST_P(GymnasiumOracle, WrongParametersAreTold) {
  const MujocoSimulatorFactory factory(GetParam(), {{.name = "gain", .field = "actuator/*/gainprm[0]"}});
  const Differences d = Replay(RecordGymnasium(GetParam(), {}), factory, std::vector{1.001});
  EXPECT_GT(d.observation, 1e-6);
}

INSTANTIATE_TEST_SUITE_P(EveryTask, GymnasiumOracle, testing::ValuesIn(TaskNames()), [](const auto& parameter) {
  std::string name = parameter.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace
}  // namespace oted
