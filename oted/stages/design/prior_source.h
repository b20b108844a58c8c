#pragma once
/// Where a prior comes from: nothing, the user's beliefs, or an earlier design.

#include <string>

#include "oted/matching/prior.h"
#include "oted/sim/parameter_space.h"

namespace oted {

enum class PriorSource { kUniform, kBeliefs, kDesign };

/// What `design.prior` names: "uniform", "gaussian", or the path of an earlier design.
PriorSource PriorSourceOf(const std::string& prior);

/// How q is represented, which says what an earlier one must be.
struct PriorUse {
  bool categorical = false;
  double grid_step = 0;
};

/// @param source  "uniform";
///                "gaussian": each parameter's `prior`, mean and standard deviation of z, which becomes a Gaussian over
///                x to first order at the mean and is never wider than the uniform prior; without one, uniform;
///                otherwise a path: a q.json (one seed's, or a mixture as `oted export --q` writes), or the run
///                directory of a finished design, whose selected seeds are taken. A mixture becomes the Gaussian of its
///                mean and covariance over x; of categorical ones the mean of the probabilities is taken.
/// @throws UsageError when no parameter has a prior, or the earlier design's q is of a kind that this one cannot use;
///         DataError when the file is damaged or its parameters, bounds or scales are not those of `space`
Prior MakePrior(const std::string& source, const ParameterSpace& space, const PriorUse& use = {});

}  // namespace oted
