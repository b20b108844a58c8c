#pragma once
/// One step of Minigrid: `MiniGridEnv.step`, and the step of its dynamic obstacles around it.

#include <span>

#include "oted/base/rng.h"
#include "oted/sim/minigrid/grid.h"

namespace oted::minigrid {

/// What a step obeys.
struct Rules {
  int max_steps = 0;              ///< truncated from this step on
  bool collision_ends = false;    ///< forward into anything but an empty cell or the goal: reward -1 and the end
  bool see_through_walls = true;  ///< no cell of the view is hidden
};

struct Outcome {
  double reward = 0;
  bool terminated = false;
  bool truncated = false;  ///< both may be true
};

/// Moves the balls, then the agent. A ball tries up to 101 uniform draws in the 3 x 3 box around it until one is an
/// empty cell without the agent; otherwise it stays. Draws from `rng` only where there are balls that move.
Outcome Step(State& state, const Rules& rules, Action action, Rng& rng);

/// The same with the balls' new places given, one per ball, in order: for comparisons with recorded episodes.
Outcome StepWithBalls(State& state, const Rules& rules, Action action, std::span<const Position> balls);

}  // namespace oted::minigrid
