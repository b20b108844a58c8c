#pragma once
/// DR: domain randomisation (Tobin et al. 2017; the paper's Sec. 5.1): an agent trained with simulator parameters drawn
/// uniformly from their ranges at every episode's start. It needs no logs and no design.

#include <vector>

#include "oted/rl/training.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// z uniform over the bounds of every parameter, of a logarithmic one in log z.
EpisodeParameters DrawUniformly(const ParameterSpace& space);

/// `n` such draws: the simulators in which checkpoints of an agent that is to do well over the whole range are
/// compared.
std::vector<std::vector<double>> UniformDraws(const ParameterSpace& space, int n, RngKey key);

}  // namespace oted
