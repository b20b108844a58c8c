#pragma once
/// The simulator M(z) as an MJCF file: for MuJoCo's viewer, for Python, for the next tool.

#include <filesystem>
#include <span>
#include <string>

#include "oted/sim/mujoco/mujoco_simulator_factory.h"

namespace oted {

/// The model of a lane that simulates z, as MJCF text with `comment` at its top.
///
/// The values that z changes are copied into what the factory's model was compiled from, and MuJoCo writes that:
/// includes are merged and comments of the original are gone. Numbers have all their digits. The text is then compiled
/// and compared with the lane's model: every number agrees to 1e-9, or this throws.
/// - Masses and inertias stay inferred from the geoms where that gives the lane's. Otherwise every body gets an
/// explicit
///   <inertial>, <compiler> no longer adjusts masses, and <statistic> keeps the nominal mean inertia, which scales the
///   solver's tolerance and which a lane does not change either.
/// - Folders of meshes and textures become absolute paths in <compiler>: the file works wherever it lies on this
///   machine. To take it elsewhere, take those folders along and change the two paths.
/// - What the simulator switches in the model for its own sake (automatic resets off) is not written.
/// @param actuator_delays_s  (nactuator) or empty: how much later than in the factory's model each actuator acts [s]:
/// MuJoCo's own delay, which shifts a command by that time, interpolated between physics steps where it is no multiple
/// of one. It knows no delay between none and one time step: such a one is rounded to either
/// @throws UsageError when z is outside its bounds; DataError when MuJoCo cannot write the values exactly.
std::string DesignedMjcf(const MujocoSimulatorFactory& factory, std::span<const double> z, const std::string& comment,
                         std::span<const double> actuator_delays_s = {});

}  // namespace oted
