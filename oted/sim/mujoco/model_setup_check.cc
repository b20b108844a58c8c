#include "oted/sim/mujoco/model_setup_check.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "oted/base/error.h"
#include "oted/sim/mujoco/model_rules.h"
#include "oted/sim/mujoco/mujoco_setup.h"
#include "oted/sim/mujoco/mujoco_simulator.h"
#include "oted/sim/mujoco/observables.h"

namespace oted {
namespace {

std::vector<double> MiddleAction(const SimulatorSpec& spec) {
  std::vector<double> action;
  for (size_t i = 0; i < spec.action_low.size(); ++i) action.push_back((spec.action_low[i] + spec.action_high[i]) / 2);
  return action;
}

// What is seen in the first steps from a state.
std::vector<double> FirstSteps(MujocoSimulator& simulator, std::span<const double> state) {
  constexpr int kSteps = 5;
  const int lane = 0;
  simulator.SetIntegrationState(lane, state);
  std::vector<double> seen(simulator.observation(lane).begin(), simulator.observation(lane).end());
  for (int step = 0; step < kSteps; ++step) {
    simulator.Step({&lane, 1}, MiddleAction(simulator.spec()));
    seen.insert(seen.end(), simulator.observation(lane).begin(), simulator.observation(lane).end());
  }
  return seen;
}

// The coordinates of qpos and qvel that task.unobserved lists.
void CheckUnobserved(const MujocoSetup& setup, const ModelPlan& plan, MujocoSimulator& simulator) {
  constexpr double kShift = 0.37, kTolerance = 1e-4;
  const mjModel& model = *setup.loaded.model;
  const std::vector<double> start(simulator.IntegrationState(0).begin(), simulator.IntegrationState(0).end());
  const auto shown = [&](StatePart part, int index) {
    const auto is_it = [&](const ModelPlan::Target& t) {
      return t.part == part && t.index == static_cast<size_t>(index);
    };
    const auto follows = [&](const Follower& follower) { return follower.Sets(part, index); };
    return std::ranges::any_of(plan.targets, is_it) || std::ranges::any_of(plan.hidden, is_it) ||
           std::ranges::any_of(plan.followers, follows);
  };
  const std::vector<double> before = FirstSteps(simulator, start);
  for (const char* all : {"joint/*/qpos", "joint/*/qvel"}) {
    for (const Observable& o : ResolveObservable(model, all, "")) {
      if (shown(o.part, o.index)) continue;
      const ptrdiff_t qpos = simulator.qpos(0).data() - simulator.IntegrationState(0).data();
      const ptrdiff_t qvel = simulator.qvel(0).data() - simulator.IntegrationState(0).data();
      // Both ways: a fall towards the floor shows, one from higher up may not.
      for (const double shift : {kShift, -kShift}) {
        std::vector<double> state = start;
        state[static_cast<size_t>((o.part == StatePart::kQpos ? qpos : qvel) + o.index)] += shift;
        mj_normalizeQuat(&model, state.data() + qpos);
        const std::vector<double> after = FirstSteps(simulator, state);
        for (size_t i = 0; i < before.size(); ++i) {
          if (std::abs(after[i] - before[i]) <= kTolerance * (1 + std::abs(before[i]))) continue;
          throw UsageError(
              fmt::format("task.unobserved lists '{}', but moving it by {} changes '{}' from {:.6g} to {:.6g} within "
                          "{} control steps: "
                          "a state cannot be set without it; observe it",
                          o.name, shift, setup.spec.observation_names[i % setup.spec.observation_names.size()],
                          before[i], after[i], before.size() / setup.spec.observation_names.size() - 1));
        }
      }
    }
  }
}

}  // namespace

void CheckModelSetup(const std::shared_ptr<const MujocoSetup>& setup) {
  MujocoSimulator simulator(setup, 1, 1);
  const ModelPlan& plan = static_cast<const ModelRules&>(simulator.rules()).plan();
  if (plan.logged_starts.rows() > 0) {
    Rng rng = RngKey(0).MakeRng();
    simulator.Reset(0, rng);
  }
  const std::vector<double> start(simulator.IntegrationState(0).begin(), simulator.IntegrationState(0).end());
  const int lane = 0;
  simulator.Step({&lane, 1}, MiddleAction(setup->spec));
  if (simulator.status(lane) == LaneStatus::kDiverged) {
    throw DataError(
        fmt::format("model '{}' diverges in the first control step from task.start; use another start, or a "
                    "smaller time step",
                    setup->model_path.string()));
  }
  if (simulator.status(lane) == LaneStatus::kTerminated) {
    throw UsageError(
        fmt::format("task.terminate \"{}\" holds one control step after task.start already; change one of "
                    "the two",
                    plan.terminate));
  }
  if (!setup->spec.can_replay()) return;
  simulator.SetIntegrationState(lane, start);
  CheckUnobserved(*setup, plan, simulator);
}

}  // namespace oted
