#pragma once
/// Checks of bodies that turn in space: the order of their quaternions, the frames of their velocities.

#include <vector>

#include "oted/data/checks.h"

namespace oted {

/// @return the velocities whose disagreement with their positions is explained by a finding
std::vector<int> CheckTurning(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
