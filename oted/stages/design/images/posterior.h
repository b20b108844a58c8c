#pragma once
/// q as the posterior: the distribution of a designer's kind that comes nearest to prior x likelihood.

#include <functional>
#include <vector>

#include "oted/base/array2.h"
#include "oted/base/rng.h"
#include "oted/matching/designer.h"

namespace oted {

/// log p(logs | z) [nats], but for a constant, at each row of u (n, d), points of the unit cube.
using LogLikelihoods = std::function<std::vector<double>(const Array2<double>& u)>;

/// The posterior under `prior`. A Gaussian prior gives the Gaussian over x of the posterior's mode and covariance, by
/// adaptive importance sampling: near a bound the mean would lie beyond what is most probable. What counts is
/// prior.prior(), whatever its own mean and spread. A grid gives its parameters' marginal probabilities: exactly up to
/// 20,000 combinations, beyond by as many draws.
Designer Posterior(const Designer& prior, const LogLikelihoods& likelihoods, RngKey key);

}  // namespace oted
