#pragma once
/// Policies as the callbacks that rollouts take.

#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/rollout.h"

namespace oted {

/// `policy` with sampled or mean actions; copies share one stream, `rng`, and scratch memory, so use it from one
/// thread. `policy` must outlive it.
BatchPolicy AsBatchPolicy(const TanhGaussianPolicy& policy, ActionNoise noise, Rng rng);
/// The mean action, which draws nothing.
BatchPolicy MeanActionPolicy(const TanhGaussianPolicy& policy);

}  // namespace oted
