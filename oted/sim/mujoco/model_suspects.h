#pragma once
/// What is often off in a model, beside the parameters that are searched.

#include <mujoco/mujoco.h>

#include <vector>

#include "oted/sim/parameter_space.h"

namespace oted {

/// Damping, armature, dry friction and springs of joints, gears, a servo's stiffness and damping, contact friction and
/// its time constant and damping (solref), inertia and gravity, each of the whole model at once, and of every body the
/// mass, alone and with the inertia, how far its centre of mass is from its frame's origin, and how far that is from
/// its parent's (in a model of more than a dozen bodies, all masses at once): as far as the model has them, in
/// multiples of nominal; of what nothing moves also where it stands, of a floor how high it lies. What the model has
/// nowhere (damping, armature, springs, friction: dry, under load, at rest) is a value of the driven joints (of all
/// joints where none is driven), from 0 to what the model's masses and lengths suggest. Where `space` has what all
/// joints, drives, tendons or bodies share, each of them alone, which multiplies it. Other numbers of `space` are left
/// out. Names are what a person would call them; some may be alike (NameApart).
std::vector<ParameterSpec> ModelSuspects(const mjModel& model, const ParameterSpace& space);

/// One of ModelSuspects of each of its joints, drives, tendons or bodies alone; none where it has one, or more than
/// eight.
std::vector<ParameterSpec> PartsOfSuspect(const mjModel& model, const ParameterSpace& space,
                                          const ParameterSpec& suspect);

}  // namespace oted
