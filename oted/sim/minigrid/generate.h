#pragma once
/// Start states of the tasks: the grids of Minigrid's `_gen_grid`, drawn from our own random streams.

#include "oted/base/rng.h"
#include "oted/sim/minigrid/grid.h"
#include "oted/sim/minigrid/task.h"

namespace oted::minigrid {

/// How often a grid that is not solvable is drawn again before an error.
inline constexpr int kMaxDraws = 1'000'000;

/// Puts `state` (with a grid of the task's size) into a new start state. `density` counts for kObstacles alone.
/// Solvable grids have the distribution of drawing until one is solvable. Where that takes long (density above some
/// 0.6), rooms of up to SolvableGrids::kMaxSide cells a side with Bernoulli placement are drawn from it directly.
/// @throws UsageError when no solvable grid turned up in kMaxDraws
void Generate(const MinigridTask& task, double density, Rng& rng, State& state);

/// The share of obstacles among the free cells of a kObstacles grid.
double RealisedDensity(const State& state);

}  // namespace oted::minigrid
