#pragma once
/// Coordinates that tell where a robot stands on a floor that is the same everywhere.

#include <mujoco/mujoco.h>

namespace oted {

/// Whether nothing depends on this entry of qpos: it moves the whole model along the world, and the world looks the
/// same from there. So it is for x and y of a robot with a free base over a plane, and for x of a planar one. False
/// where that cannot be told from the model alone: several separate trees, equality constraints, tendons, flexes,
/// static geoms that are no planes.
bool IsPlace(const mjModel& model, int qpos);

}  // namespace oted
