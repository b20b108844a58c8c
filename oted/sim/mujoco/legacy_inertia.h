#pragma once
/// Capsules as MuJoCo weighed them before version 2.1.1, the engine of the D4RL recordings (docs/legacy_engine.md).

#include <mujoco/mujoco.h>

#include <array>
#include <string>

namespace oted {

/// Mass [kg] and moments about the centre of mass, along the geom's axes [kg m^2].
struct MassAndInertia {
  double mass = 0;
  std::array<double, 3> moments{};
};

/// A capsule along z as a cylinder that is longer by half a radius at each end.
/// @param density  [kg/m^3]
MassAndInertia LegacyCapsule(double radius, double half_length, double density);

/// Gives every body of `spec` whose mass comes from capsules that mass and inertia explicitly; other bodies and
/// settotalmass stay as they are.
/// @param nominal  what `spec` compiles to as it stands
/// @param name     of the model file, for errors
/// @throws DataError for a body that has capsules beside geoms of other types, or a capsule with its mass on the
/// surface: there is no engine to compare with.
void UseLegacyCapsules(mjSpec& spec, const mjModel& nominal, const std::string& name);

}  // namespace oted
