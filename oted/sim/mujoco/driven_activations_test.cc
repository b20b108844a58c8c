#include "oted/sim/mujoco/driven_activations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/mujoco/testing.h"

namespace oted::driven_activations_test {

using testing::HasSubstr;

/// Two drives with lags, of which one saturates in its control and one in its activation.
constexpr const char* kDrives = R"(<mujoco>
  <option timestep="0.004" integrator="{}"/>
  <worldbody>
    <body><joint name="a" axis="0 1 0" damping="0.1"/><geom size="0.1" pos="0.2 0 0"/></body>
    <body pos="0 1 0"><joint name="b" axis="0 1 0" damping="0.1"/><geom size="0.1" pos="0.2 0 0"/></body>
  </worldbody>
  <actuator>
    <general name="a" joint="a" dyntype="filter" dynprm="0.03" gainprm="2" ctrlrange="-0.7 0.7"/>
    <general name="b" joint="b" dyntype="{}" dynprm="0.06" gainprm="2" ctrlrange="-1 1" actrange="-0.4 0.4"
             actlimited="true"/>
  </actuator>
</mujoco>
)";

ModelTask Task(const TestFolder& folder, const char* integrator, const char* second = "filterexact") {
  WriteFileAtomically(folder / "drives.xml", fmt::format(fmt::runtime(kDrives), integrator, second));
  ModelTask task;
  task.name = "Drives";
  task.model = folder / "drives.xml";
  task.control_period = 0.02;
  task.observations = {"joint/*/qpos", "joint/*/qvel"};
  task.max_episode_steps = 1000;
  return task;
}

/// One lane's observations and the actions that led there, from rest.
struct Recording {
  std::vector<double> observations, actions;
};

Recording Record(Simulator& simulator, int n_steps) {
  Recording recording;
  Rng rng = RngKey(4).MakeRng();
  simulator.Reset(0, rng);
  const int lane = 0;
  for (int t = 0; t < n_steps; ++t) {
    const auto seen = simulator.observation(lane);
    recording.observations.insert(recording.observations.end(), seen.begin(), seen.end());
    // Also beyond the ranges.
    const std::vector<double> action = {rng.Uniform(-1.2, 1.2), rng.Uniform(-1.2, 1.2)};
    recording.actions.insert(recording.actions.end(), action.begin(), action.end());
    simulator.Step({&lane, 1}, action);
  }
  return recording;
}

/// The largest difference between the recording and a simulator that is set to its row `start` and goes on from there.
double ErrorFrom(Simulator& simulator, const Recording& recording, size_t start, bool with_history = true) {
  const size_t obs_dim = 4, act_dim = 2, n = recording.actions.size() / act_dim;
  const auto row = [&](size_t i) { return std::span(recording.observations).subspan(i * obs_dim, obs_dim); };
  LoggedHistory before;
  if (with_history) {
    before = {std::span(recording.observations).first(start * obs_dim),
              std::span(recording.actions).first(start * act_dim)};
  }
  EXPECT_TRUE(simulator.SetState(0, row(start), before));
  double error = 0;
  const int lane = 0;
  for (size_t i = start; i + 1 < n; ++i) {
    simulator.Step({&lane, 1}, std::span(recording.actions).subspan(i * act_dim, act_dim));
    for (size_t j = 0; j < obs_dim; ++j) error = std::max(error, std::abs(simulator.observation(0)[j] - row(i + 1)[j]));
  }
  return error;
}

class DrivenActivations : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Integrators, DrivenActivations, testing::Values("Euler", "RK4", "implicitfast"),
                         [](const auto& integrator) { return std::string(integrator.param); });

TEST_P(DrivenActivations, AStateSetFromTheLogGoesOnAsTheSimulationThatWroteIt) {
  const TestFolder folder;
  const ParameterSpec lag = {.name = "lag", .field = "actuator/*/dynprm[0]", .low = 0.5, .high = 3};
  const MujocoSimulatorFactory factory(Task(folder, GetParam()), {lag});
  const auto simulator = factory.Make(1, 1);
  for (const double z : {1.0, 2.5}) {
    simulator->SetParameters(0, std::vector{z});
    const Recording recording = Record(*simulator, 60);
    for (const size_t start : {1, 7, 40})
      EXPECT_LT(ErrorFrom(*simulator, recording, start), 1e-11) << z << " " << start;
    EXPECT_GT(ErrorFrom(*simulator, recording, 40, false), 1e-3) << "the history matters";
  }
  // 4.6 time constants of the slower drive at its slowest.
  EXPECT_EQ(factory.spec().n_rows_before, static_cast<int>(std::ceil(4.6 * 3 * 0.06 / 0.02)));
  EXPECT_TRUE(factory.spec().hidden.empty());
  EXPECT_TRUE(factory.spec().can_set_state);
}

TEST(DrivenActivations, FollowTheCommandsThatADelayLetThrough) {
  const TestFolder folder;
  const ParameterSpec delay = {
      .name = "delay", .field = "action/delay", .low = 0, .high = 3, .scale = ParameterScale::kAbsolute};
  const auto plant = [&](const auto& specs) {
    return std::make_unique<MujocoSimulatorFactory>(Task(folder, "Euler"), specs);
  };
  const auto simulator = WithChannels({delay}, plant)->Make(1, 1);
  simulator->SetParameters(0, std::vector{2.0});
  const Recording recording = Record(*simulator, 60);
  EXPECT_LT(ErrorFrom(*simulator, recording, 40), 1e-11);
}

TEST(DrivenActivations, AnActivationThatRemembersForEverIsNone) {
  const TestFolder folder;
  const MujocoSimulatorFactory factory(Task(folder, "Euler", "integrator"), {});
  EXPECT_FALSE(factory.spec().can_set_state);
  EXPECT_THAT(factory.why_not_settable(), HasSubstr("no observation shows actuator/b/act;"));
  ASSERT_EQ(factory.spec().hidden.size(), 1u);
}

}  // namespace oted::driven_activations_test
