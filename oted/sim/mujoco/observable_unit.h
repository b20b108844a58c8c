#pragma once
/// The units of what can be seen of a model.

#include <mujoco/mujoco.h>

#include <string>

#include "oted/sim/mujoco/observables.h"

namespace oted {

/// "rad", "m/s", "N m", ...; empty where the number has none (a quaternion) or where it cannot be told (a tendon that
/// adds joints up, a sensor of the user's own).
std::string UnitOf(const mjModel& model, const Observable& observable);

}  // namespace oted
