#pragma once
/// What a task file claims, tried in its simulator.

#include <memory>

#include "oted/sim/mujoco/mujoco_setup.h"

namespace oted {

/// Takes a few steps from the start state: expressions must give finite numbers there, the episode must not end at
/// once, and what is declared unobserved must change nothing that is seen.
/// @throws UsageError, DataError
void CheckModelSetup(const std::shared_ptr<const MujocoSetup>& setup);

}  // namespace oted
