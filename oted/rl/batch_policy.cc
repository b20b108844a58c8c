#include "oted/rl/batch_policy.h"

#include <memory>

namespace oted {

BatchPolicy AsBatchPolicy(const TanhGaussianPolicy& policy, ActionNoise noise, Rng rng) {
  struct State {
    PolicyRunner runner;
    Rng rng;
  };
  // A std::function is copied; the stream must not be.
  const auto state = std::make_shared<State>(PolicyRunner(policy, noise), rng);
  return [state](std::span<const double> observations, int n, std::span<double> actions) {
    state->runner.Act(observations, n, state->rng, actions);
  };
}

BatchPolicy MeanActionPolicy(const TanhGaussianPolicy& policy) {
  return AsBatchPolicy(policy, ActionNoise::kMean, Rng(0));
}

}  // namespace oted
