#pragma once
/// Limits of forces that a model does not have: real drives saturate, and many models leave that out.

#include <vector>

#include "oted/sim/mujoco/model.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// Twice the largest force that a drive without a force limit asks for within the ranges of its control and its joint
/// [N | N m]: as a limit it never acts. 0 where it has a limit, or where that cannot be told.
double UnreachedForce(const mjModel& model, int actuator);

/// The same model in which drives without a force limit have their UnreachedForce for one.
ModelPtr WithForceLimits(const mjModel& model);

/// Gives these limits to the drives whose actuator/NAME/forcerange a parameter sets: MuJoCo heeds none that the model
/// lacks. Simulations of the nominal model stay the same, and so does its fingerprint. @throws UsageError
void LetForcesBeLimited(const std::vector<ParameterSpec>& specs, LoadedModel& loaded);

}  // namespace oted
