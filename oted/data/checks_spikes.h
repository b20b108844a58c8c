#pragma once
/// Check of single readings that are far off.

#include <vector>

#include "oted/data/checks.h"

namespace oted {

/// Positions and velocities that leave their course for one row and are back in the next.
void CheckSpikes(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
