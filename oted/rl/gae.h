#pragma once
/// Generalised advantage estimation (Schulman et al. 2016) on a rollout of several lanes.

#include <cstdint>
#include <span>

namespace oted {

/// What became of an episode in a step of a rollout.
enum class StepEnd : uint8_t {
  kNone,     ///< goes on: the next state's value follows
  kEpisode,  ///< ended: nothing follows (the caller adds gamma V(s') to the reward where the clock ended it)
  kDropped,  ///< the step means nothing: no advantage, and the step before bootstraps through its state
};

/// Steps t = 0, ..., T - 1 of n lanes: arrays (T, n), row-major.
struct RolloutSteps {
  std::span<const float> rewards, values;
  std::span<const StepEnd> ends;
  std::span<const float> last_values;  ///< (n) of the states after the last step; not read where it ended an episode
};
/// Likewise (T, n), overwritten: 0 and V(s_t) for dropped steps.
struct Advantages {
  std::span<float> advantages, returns;
};

///   delta_t = r_t + gamma V(s_{t+1}) - V(s_t),   A_t = delta_t + gamma lambda A_{t+1},   return_t = A_t + V(s_t),
/// where nothing follows the end of an episode, and after a dropped step A starts anew.
void GeneralizedAdvantages(const RolloutSteps& steps, double gamma, double lambda, const Advantages& out);

}  // namespace oted
