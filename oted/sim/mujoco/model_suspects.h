#pragma once
/// What is often off in a model, beside the parameters that are searched.

#include <mujoco/mujoco.h>

#include <vector>

#include "oted/sim/parameter_space.h"

namespace oted {

/// Joint damping, armature, dry friction and stiffness, gears, contact friction and gravity, each of the whole model at
/// once, and every body's mass (in a model of more than a dozen bodies, all masses at once): as far as the model has
/// them, in multiples of nominal, named by their paths. What shares a place with `searched` is left out.
std::vector<ParameterSpec> ModelSuspects(const mjModel& model, const ParameterSpace& searched);

}  // namespace oted
