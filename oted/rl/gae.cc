#include "oted/rl/gae.h"

#include "oted/base/error.h"

namespace oted {

void GeneralizedAdvantages(const RolloutSteps& steps, double gamma, double lambda, const Advantages& out) {
  const auto& [rewards, values, ends, last_values] = steps;
  const auto& [advantages, returns] = out;
  const size_t n = last_values.size(), size = rewards.size();
  OTED_CHECK(n > 0 && size % n == 0 && values.size() == size && ends.size() == size && advantages.size() == size &&
             returns.size() == size);
  for (size_t lane = 0; lane < n; ++lane) {
    double next_value = static_cast<double>(last_values[lane]), next_advantage = 0;
    for (size_t i = size - n + lane;; i -= n) {
      const double value = static_cast<double>(values[i]);
      double advantage = 0;
      if (ends[i] == StepEnd::kEpisode) next_value = next_advantage = 0;
      if (ends[i] != StepEnd::kDropped) {
        advantage = static_cast<double>(rewards[i]) + gamma * next_value - value + gamma * lambda * next_advantage;
      }
      advantages[i] = static_cast<float>(advantage);
      returns[i] = static_cast<float>(advantage + value);
      next_value = value;
      next_advantage = advantage;
      if (i < n) break;
    }
  }
}

}  // namespace oted
