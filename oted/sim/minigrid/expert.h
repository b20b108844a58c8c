#pragma once
/// Behaviour in a grid world by someone who sees the whole of it: shortest paths, and shortest paths with mistakes.

#include <functional>
#include <vector>

#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/sim/minigrid/grid.h"
#include "oted/sim/minigrid/minigrid_simulator.h"

namespace oted {

/// The fewest actions (turns and forward moves) to the nearest goal, over the cells on which an agent may stand without
/// an end: empty ones, floor, open doors. Moving balls count where they are now.
class ShortestPaths {
 public:
  explicit ShortestPaths(const minigrid::Grid& grid);
  static constexpr int kUnreachable = -1;

  /// From (x, y) looking in `direction`; kUnreachable when no path leads to a goal.
  int Actions(int x, int y, int direction) const { return distances_[Index(x, y, direction)]; }
  /// The same from the agent's place.
  int Actions(const minigrid::State& state) const { return Actions(state.x, state.y, state.direction); }
  /// Those of forward, left, right that a shortest path begins with, in this order; empty without a path or at a goal.
  std::vector<minigrid::Action> Best(const minigrid::State& state) const;

 private:
  size_t Index(int x, int y, int direction) const {
    return static_cast<size_t>((y * grid_->width() + x) * 4 + direction);
  }
  const minigrid::Grid* grid_;
  std::vector<int> distances_;
};

enum class TieBreak {
  kFixed,   ///< forward before left before right
  kRandom,  ///< uniformly among the best
};

/// Chooses an action from the true state of one lane; `rng` is the lane's own stream.
using MinigridPolicy = std::function<minigrid::Action(const minigrid::State& state, Rng& rng)>;

/// Takes a shortest path, planned anew at every step since balls move. Without one it turns left and waits.
MinigridPolicy MinigridExpert(TieBreak ties = TieBreak::kFixed);

/// The expert with mistakes: each action is replaced by a uniformly random one of left, right and forward with
/// probability `mistakes`. With lava or collision = "terminate" a mistake can end the episode.
/// @throws UsageError unless mistakes is in [0, 1]
MinigridPolicy MinigridMedium(double mistakes = 0.3, TieBreak ties = TieBreak::kFixed);

/// LogOnTrueStates of `n_episodes` episodes in lanes of their own. @throws UsageError unless there is at least one
Dataset CollectMinigridDemonstrations(const MinigridSimulatorFactory& factory, const std::vector<double>& z,
                                      const MinigridPolicy& policy, int n_episodes, RngKey key, int n_threads);

}  // namespace oted
