#pragma once
/// Whether two compiled models simulate alike.

#include <mujoco/mujoco.h>

#include <string>

namespace oted {

/// "geom_friction[12] is 0.5, not 0.6" for the first number in which `got` differs from `wanted` by more than 1e-9 of
/// its size (1e-12 near zero), or the count of objects that differs; "" when there is none. Compares every
/// floating-point array, the physics options and the mean inertia that scales the solver's tolerance.
std::string FirstDifference(const mjModel& got, const mjModel& wanted);

}  // namespace oted
