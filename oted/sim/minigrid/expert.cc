#include "oted/sim/minigrid/expert.h"

#include <fmt/format.h>

#include "oted/base/error.h"
#include "oted/base/fields.h"

namespace oted {

using minigrid::Action;
using minigrid::Cell;
using minigrid::kDirections;
using minigrid::Kind;
using minigrid::State;

namespace {

bool IsSafe(Cell cell) { return cell.CanOverlap() && cell.kind() != Kind::kLava; }

}  // namespace

ShortestPaths::ShortestPaths(const minigrid::Grid& grid)
    : grid_(&grid), distances_(static_cast<size_t>(grid.width() * grid.height() * 4), kUnreachable) {
  // Breadth first from the goals, backwards: a turn is undone by the other turn, a step by one back.
  struct Pose {
    int x, y, direction;
  };
  std::vector<Pose> queue;
  const auto reach = [&](int x, int y, int direction, int distance) {
    int& known = distances_[Index(x, y, direction)];
    if (known != kUnreachable) return;
    known = distance;
    queue.push_back({x, y, direction});
  };
  for (int y = 0; y < grid.height(); ++y) {
    for (int x = 0; x < grid.width(); ++x) {
      if (grid.at(x, y).kind() != Kind::kGoal) continue;
      for (int direction = 0; direction < 4; ++direction) reach(x, y, direction, 0);
    }
  }
  for (size_t head = 0; head < queue.size(); ++head) {
    const auto [x, y, direction] = queue[head];
    const int distance = Actions(x, y, direction) + 1;
    reach(x, y, (direction + 1) & 3, distance);
    reach(x, y, (direction + 3) & 3, distance);
    const minigrid::Position& ahead = kDirections[static_cast<size_t>(direction)];
    const int from_x = x - ahead.x, from_y = y - ahead.y;
    if (grid.Contains(from_x, from_y) && IsSafe(grid.at(from_x, from_y))) reach(from_x, from_y, direction, distance);
  }
}

std::vector<Action> ShortestPaths::Best(const State& state) const {
  std::vector<Action> best;
  const int distance = Actions(state);
  if (distance <= 0) return best;
  const minigrid::Position front = state.front();
  if (grid_->Contains(front.x, front.y) && IsSafe(grid_->at(front.x, front.y)) &&
      Actions(front.x, front.y, state.direction) == distance - 1) {
    best.push_back(minigrid::kForward);
  }
  if (Actions(state.x, state.y, (state.direction + 3) & 3) == distance - 1) best.push_back(minigrid::kLeft);
  if (Actions(state.x, state.y, (state.direction + 1) & 3) == distance - 1) best.push_back(minigrid::kRight);
  return best;
}

MinigridPolicy MinigridExpert(TieBreak ties) {
  return [ties](const State& state, Rng& rng) {
    const std::vector<Action> best = ShortestPaths(state.grid).Best(state);
    if (best.empty()) return minigrid::kLeft;
    return best[ties == TieBreak::kFixed ? 0 : rng.Below(best.size())];
  };
}

MinigridPolicy MinigridMedium(double mistakes, TieBreak ties) {
  if (!(mistakes >= 0 && mistakes <= 1)) {
    throw UsageError(fmt::format("got a share of mistakes of {}, wanted one in [0, 1]", mistakes));
  }
  return [mistakes, expert = MinigridExpert(ties)](const State& state, Rng& rng) {
    if (rng.Uniform() < mistakes) return static_cast<Action>(rng.Below(3));
    return expert(state, rng);
  };
}

MinigridPolicy MinigridPolicyNamed(const std::string& name) {
  if (name == "expert") return MinigridExpert();
  if (name == "medium") return MinigridMedium();
  throw UsageError(fmt::format("got policy '{}'{}, wanted expert or medium for a MiniGrid task", name,
                               DidYouMean(name, {"expert", "medium"})));
}

BatchPolicy OnTrueStates(const MinigridSimulator& simulator, const MinigridPolicy& policy, Rng rng) {
  return [&simulator, policy, rng](std::span<const double>, int n, std::span<double> actions) mutable {
    // The rows are those of the lanes that run, in their order.
    size_t row = 0;
    for (int lane = 0; lane < simulator.n_lanes(); ++lane) {
      if (simulator.status(lane) == LaneStatus::kRunning) actions[row++] = policy(simulator.state(lane), rng);
    }
    OTED_CHECK(row == static_cast<size_t>(n));
  };
}

Dataset CollectMinigridDemonstrations(const MinigridSimulatorFactory& factory, const std::vector<double>& z,
                                      const MinigridPolicy& policy, int n_episodes, RngKey key, int n_threads) {
  if (n_episodes < 1) throw UsageError(fmt::format("got {} episodes, wanted at least 1", n_episodes));
  const auto simulator = factory.MakeMinigrid(n_episodes, n_threads);
  std::vector<int> running;
  std::vector<Rng> streams;
  for (int lane = 0; lane < n_episodes; ++lane) {
    const RngKey episode = key.Index(static_cast<uint64_t>(lane));
    simulator->SetParameters(lane, z);
    Rng start = episode.Stage("start").MakeRng();
    simulator->Reset(lane, start);
    streams.push_back(episode.Stage("policy").MakeRng());
    running.push_back(lane);
  }
  std::vector<Dataset> logs(static_cast<size_t>(n_episodes));
  std::vector<double> actions(static_cast<size_t>(n_episodes));
  while (!running.empty()) {
    for (const int lane : running) {
      const auto i = static_cast<size_t>(lane);
      actions[i] = policy(simulator->state(lane), streams[i]);
      logs[i].observations.AppendRow(simulator->observation(lane));
      logs[i].actions.AppendRow({&actions[i], 1});
    }
    simulator->Step(running, actions);
    std::vector<int> still_running;
    for (const int lane : running) {
      Dataset& log = logs[static_cast<size_t>(lane)];
      const LaneStatus status = simulator->status(lane);
      log.next_observations.AppendRow(simulator->observation(lane));
      // D4RL's files hold float32: what is logged is what is read back.
      log.rewards.push_back(static_cast<double>(static_cast<float>(simulator->reward(lane))));
      log.terminals.push_back(status == LaneStatus::kTerminated);
      log.timeouts.push_back(status == LaneStatus::kTruncated);
      if (status == LaneStatus::kRunning) still_running.push_back(lane);
    }
    running = std::move(still_running);
  }
  Dataset dataset;
  for (const Dataset& log : logs) dataset.Append(log);
  return dataset;
}

}  // namespace oted
