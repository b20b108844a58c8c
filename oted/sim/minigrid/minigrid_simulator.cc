#include "oted/sim/minigrid/minigrid_simulator.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/sim/minigrid/expert.h"
#include "oted/sim/minigrid/generate.h"
#include "oted/sim/minigrid/view.h"

namespace oted {
namespace {

constexpr const char* kDensityField = "env/density";
// Lanes per thread from which a second thread pays: it costs some ten microseconds, a step a fifth of one.
constexpr int kLanesPerThread = 1024;

SimulatorSpec MakeSpec(const MinigridTask& task) {
  SimulatorSpec spec;
  spec.task = task.name;
  const int side = task.observation == GridObservation::kWhole ? task.size : minigrid::kView;
  spec.image_shape = {side, side, 3};
  spec.observation_shape = {side * side * 3 + 1};
  for (int i = 0; i < side * side; ++i) {
    spec.observation_levels.insert(spec.observation_levels.end(),
                                   {minigrid::kKinds, minigrid::kColours, minigrid::kStates});
  }
  spec.observation_levels.push_back(static_cast<int>(minigrid::kDirections.size()));
  spec.act_dim = 1;
  spec.n_discrete_actions = task.n_actions;
  spec.action_low = {0};
  spec.action_high = {static_cast<double>(task.n_actions - 1)};
  spec.max_episode_steps = task.time_limit();
  return spec;
}

// Fills in what the task knows of its parameters.
ParameterSpec Resolve(const MinigridTask& task, ParameterSpec spec) {
  spec.Check();
  if (task.layout != MinigridLayout::kObstacles) {
    throw UsageError(fmt::format("task '{}' has no parameter, got '{}' ({}); MiniGrid-Obstacles-10x10 has {}",
                                 task.name, spec.name, spec.field, kDensityField));
  }
  if (spec.field != kDensityField) {
    throw UsageError(fmt::format("parameter '{}': task '{}' has no field '{}'{}; it has {}", spec.name, task.name,
                                 spec.field, DidYouMean(spec.field, {kDensityField}), kDensityField));
  }
  const bool absolute = spec.scale == ParameterScale::kAbsolute;
  const double unit = absolute ? 1 : task.density;
  if (spec.low * unit < 0 || spec.high * unit >= 1) {
    throw UsageError(fmt::format("parameter '{}': got densities in [{}, {}], wanted them in [0, 1); narrow its range",
                                 spec.name, spec.low * unit, spec.high * unit));
  }
  spec.unit = absolute ? "probability of an obstacle" : "x nominal";
  spec.nominal = absolute ? task.density : 1;
  return spec;
}

std::shared_ptr<const MinigridSetup> MakeSetup(MinigridTask task, std::vector<ParameterSpec> specs) {
  auto setup = std::make_shared<MinigridSetup>();
  task.Check();
  for (ParameterSpec& spec : specs) spec = Resolve(task, spec);
  if (specs.size() > 1) {
    throw UsageError(
        fmt::format("parameters '{}' and '{}' are both {}; remove one", specs[0].name, specs[1].name, kDensityField));
  }
  setup->spec = MakeSpec(task);
  setup->rules = task.rules();
  setup->space = ParameterSpace(std::move(specs));
  setup->task = std::move(task);
  return setup;
}

}  // namespace

MinigridSimulator::MinigridSimulator(std::shared_ptr<const MinigridSetup> setup, int n_lanes, int n_threads)
    : setup_(std::move(setup)), n_threads_(n_threads) {
  if (n_lanes < 1 || n_threads < 1) {
    throw UsageError(fmt::format("got {} lanes and {} threads, wanted at least 1 of each", n_lanes, n_threads));
  }
  observations_ = Array2<double>(n_lanes, setup_->spec.obs_dim() + 1);
  Lane empty;
  empty.state.grid = minigrid::Grid(setup_->task.size, setup_->task.size);
  empty.state.grid.MakeRoom();
  empty.density = setup_->task.density;
  lanes_.assign(static_cast<size_t>(n_lanes), empty);
  for (int lane = 0; lane < n_lanes; ++lane) Observe(lane);
}

void MinigridSimulator::SetParameters(int lane, std::span<const double> z) {
  setup_->space.CheckInside(z);
  if (z.empty()) return;
  const bool absolute = setup_->space[0].scale == ParameterScale::kAbsolute;
  At(lane).density = absolute ? z[0] : z[0] * setup_->task.density;
}

void MinigridSimulator::Reset(int lane, Rng& rng) {
  Lane& l = At(lane);
  minigrid::Generate(setup_->task, l.density, rng, l.state);
  l.rng = Rng(rng.Next());
  StartEpisode(lane);
}

bool MinigridSimulator::SetStateFromObservation(int, std::span<const double>) {
  throw UsageError(
      fmt::format("task '{}' has no settable state, since an observation does not show the whole of it; "
                  "start at its resets (design.method = \"paper\")",
                  setup_->task.name));
}

void MinigridSimulator::SetState(int lane, const minigrid::State& state) {
  const int size = setup_->task.size;
  if (state.grid.width() != size || state.grid.height() != size || !state.grid.Contains(state.x, state.y)) {
    throw UsageError(fmt::format("got a grid of {} x {} with the agent at ({}, {}), wanted {} x {} for '{}'",
                                 state.grid.width(), state.grid.height(), state.x, state.y, size, size,
                                 setup_->task.name));
  }
  At(lane).state = state;
  StartEpisode(lane);
}

void MinigridSimulator::Step(std::span<const int> lanes, std::span<const double> actions) {
  OTED_CHECK(actions.size() == lanes_.size());
  const int n_actions = setup_->task.n_actions;
  for (const int lane : lanes) {
    const double action = actions[Checked(lane)];
    // Written so that NaN is wrong.
    if (!(action >= 0 && action < n_actions) || action != static_cast<int>(action)) {
      throw UsageError(fmt::format("lane {}: got action {}, wanted an index 0, ..., {}", lane, action, n_actions - 1));
    }
  }
  const auto step = [&](int lane) {
    Lane& l = At(lane);
    const auto action = static_cast<minigrid::Action>(static_cast<int>(actions[static_cast<size_t>(lane)]));
    Finish(lane, minigrid::Step(l.state, setup_->rules, action, l.rng));
  };
  const int n = static_cast<int>(lanes.size());
  const int n_shards = std::min(n_threads_, n / kLanesPerThread);
  if (n_shards <= 1) {
    for (const int lane : lanes) step(lane);
    return;
  }
  ParallelFor(n_shards, n_shards, [&](int shard) {
    const auto bound = [&](int s) { return static_cast<size_t>(static_cast<int64_t>(n) * s / n_shards); };
    for (const int lane : lanes.subspan(bound(shard), bound(shard + 1) - bound(shard))) step(lane);
  });
}

void MinigridSimulator::StepWithBalls(int lane, minigrid::Action action, std::span<const minigrid::Position> balls) {
  Finish(lane, minigrid::StepWithBalls(At(lane).state, setup_->rules, action, balls));
}

void MinigridSimulator::Finish(int lane, const minigrid::Outcome& outcome) {
  Lane& l = At(lane);
  l.reward = outcome.reward;
  l.status = outcome.terminated  ? LaneStatus::kTerminated
             : outcome.truncated ? LaneStatus::kTruncated
                                 : LaneStatus::kRunning;
  Observe(lane);
}

void MinigridSimulator::StartEpisode(int lane) {
  Lane& l = At(lane);
  l.reward = 0;
  l.status = LaneStatus::kRunning;
  Observe(lane);
}

void MinigridSimulator::Observe(int lane) {
  const minigrid::State& state = At(lane).state;
  const std::span<double> row = observations_.row(lane);
  if (setup_->task.observation == GridObservation::kWhole) {
    minigrid::EncodeGrid(state, row);
  } else {
    minigrid::EncodeView(state, setup_->rules.see_through_walls, row);
  }
  row[row.size() - 2] = state.direction;
}

void MinigridSimulator::TakeTaskPolicy(TaskPolicy policy, int lane, Rng& rng, std::span<double> action) const {
  const MinigridPolicy choose = policy == TaskPolicy::kExpert ? MinigridExpert() : MinigridMedium();
  action[0] = choose(state(lane), rng);
}

std::span<const double> MinigridSimulator::observation(int lane) const {
  const std::span<const double> row = observations_.row(lane);
  return row.first(row.size() - 1);
}

double MinigridSimulator::realised_density(int lane) const {
  OTED_CHECK(setup_->task.layout == MinigridLayout::kObstacles);
  return minigrid::RealisedDensity(At(lane).state);
}

MinigridSimulatorFactory::MinigridSimulatorFactory(MinigridTask task, std::vector<ParameterSpec> specs)
    : setup_(MakeSetup(std::move(task), std::move(specs))) {}

MinigridSimulatorFactory::MinigridSimulatorFactory(const std::string& task, std::vector<ParameterSpec> specs)
    : MinigridSimulatorFactory(FindMinigridTask(task), std::move(specs)) {}

std::unique_ptr<Simulator> MinigridSimulatorFactory::Make(int n_lanes, int n_threads) const {
  return MakeMinigrid(n_lanes, n_threads);
}

std::unique_ptr<MinigridSimulator> MinigridSimulatorFactory::MakeMinigrid(int n_lanes, int n_threads) const {
  return std::make_unique<MinigridSimulator>(setup_, n_lanes, n_threads);
}

}  // namespace oted
