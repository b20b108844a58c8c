#pragma once
/// Limits of forces that a model does not have: real drives saturate, and many models leave that out.

#include <vector>

#include "oted/sim/mujoco/model.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// A hundred times the largest force that a drive without a force limit asks for within the ranges of its control and
/// its joint [N | N m]: as a limit it never acts, though dampers add to it and its strength may be searched. 0 where
/// the drive has a limit, or where that cannot be told.
double UnreachedForce(const mjModel& model, int actuator);

/// Gives these limits, or the top of the parameter's range where that is less, to the drives whose force_limit or
/// forcerange it sets: MuJoCo heeds none that the model lacks. By limits that are not reached simulations stay the
/// same; the model's fingerprint does. @throws UsageError also where a drive of a force_limit has none and can get none
void LetForcesBeLimited(const std::vector<ParameterSpec>& specs, LoadedModel& loaded);

}  // namespace oted
