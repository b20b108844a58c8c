#include "oted/sim/minigrid/expert.h"

#include <fmt/format.h>

#include "oted/base/error.h"
#include "oted/sim/task_policy.h"

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

Dataset CollectMinigridDemonstrations(const MinigridSimulatorFactory& factory, const std::vector<double>& z,
                                      const MinigridPolicy& policy, int n_episodes, RngKey key, int n_threads) {
  if (n_episodes < 1) throw UsageError(fmt::format("got {} episodes, wanted at least 1", n_episodes));
  const auto simulator = factory.MakeMinigrid(n_episodes, n_threads);
  return LogOnTrueStates(*simulator, z, key, [&](int lane, Rng& rng, std::span<double> action) {
    action[0] = policy(simulator->state(lane), rng);
  });
}

}  // namespace oted
