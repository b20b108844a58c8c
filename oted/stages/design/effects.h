#pragma once
/// Does each parameter change anything that the logs could show?

#include <vector>

#include "oted/base/array2.h"
#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

inline constexpr double kBreaksDown = 1e9;  ///< a change: the physics breaks down at one end of the range

/// What one parameter does to replayed episodes.
struct ParameterEffect {
  /// Largest change of any observation, in standard deviations of that observation in the dataset, when the parameter
  /// goes from one bound over its nominal value to the other and all others stay nominal. Exactly 0: no measured
  /// effect.
  double largest_change = 0;
  /// The same for each observation: (obs_dim).
  std::vector<double> by_observation;
};

/// Replays the logged actions of whole episodes (at most `max_episodes`), from reset states and, where states can be
/// set, from each episode's first logged state, in simulators that differ in one parameter. Resets count: a parameter
/// may act there alone.
std::vector<ParameterEffect> MeasureEffects(const SimulatorFactory& factory, const Dataset& dataset, int max_episodes,
                                            RngKey key, int n_threads);

/// Of each parameter, whether MeasureEffects would find one. It ends as soon as all have.
std::vector<bool> HaveEffects(const SimulatorFactory& factory, const Dataset& dataset, int max_episodes, RngKey key,
                              int n_threads);

/// How alike the effects of two parameters are: the cosine of their effect vectors, (d, d) with ones on the diagonal.
/// An effect vector is the change of every observation, in its standard deviations, over short replays
/// (`kTradeOffSteps` control steps from up to `n_starts` logged states, or from resets where states cannot be set) when
/// the parameter moves by a fiftieth of its range about nominal. Near 1 or -1 the logs show one combination of the two
/// and not each; 0 where one of them has no effect.
Array2<double> EffectCosines(const SimulatorFactory& factory, const Dataset& dataset, int n_starts, RngKey key,
                             int n_threads);
inline constexpr int kTradeOffSteps = 10;
/// The cosines of any two of d vectors, from their inner products (d, d): 1 on the diagonal, 0 where one has no length.
Array2<double> CosinesOf(const Array2<double>& products);

}  // namespace oted
