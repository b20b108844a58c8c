#pragma once
/// Does each parameter change anything that the logs could show?

#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

/// What one parameter does to replayed episodes.
struct ParameterEffect {
  /// Largest change of any observation, in standard deviations of that observation in the dataset, when the parameter
  /// goes from one bound to the other and all others stay nominal. Exactly 0: no measured effect.
  double largest_change = 0;
};

/// Replays the logged actions of whole episodes (at most `max_episodes`), from reset states and, where states can be
/// set, from each episode's first logged state, in simulators that differ in one parameter. Resets count: a parameter
/// may act there alone.
std::vector<ParameterEffect> MeasureEffects(const SimulatorFactory& factory, const Dataset& dataset, int max_episodes,
                                            RngKey key, int n_threads);

}  // namespace oted
