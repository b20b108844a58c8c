#pragma once
/// What is often off in a model, beside the parameters that are searched.

#include <mujoco/mujoco.h>

#include <vector>

#include "oted/sim/parameter_space.h"

namespace oted {

/// Joint damping, armature, dry friction and stiffness, gears, a servo's stiffness and damping, contact friction and
/// its time constant and damping (solref), inertia and gravity, each of the whole model at once, and every body's mass
/// and how far its centre of mass is from its frame's origin (in a model of more than a dozen bodies, all masses at
/// once): as far as the model has them, in multiples of nominal.
/// Damping, armature and friction (dry, under load, at rest) that the model has nowhere are values of the driven joints
/// (of all joints where none is driven), from 0 to what the model's masses and lengths suggest. Names are what a person
/// would call them, and none of `searched`. What shares a place with `searched` is left out.
std::vector<ParameterSpec> ModelSuspects(const mjModel& model, const ParameterSpace& space);

/// One of ModelSuspects of each of its joints, drives or tendons alone; none where it has one, or more than eight.
std::vector<ParameterSpec> PartsOfSuspect(const mjModel& model, const ParameterSpace& space,
                                          const ParameterSpec& suspect);

}  // namespace oted
