#pragma once
/// Everything in a model that can be a parameter.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "oted/sim/parameter_info.h"

namespace oted {

/// Fields by owner in the order of the path grammar, each with all its places in the model; owners without objects are
/// left out.
std::vector<ParameterOffer> ModelOffers(const mjModel& model);

/// What one path stands for. @throws UsageError as ResolvePath.
PathInfo DescribeModelPath(const mjModel& model, const std::string& path);

}  // namespace oted
