#pragma once
/// Readings that stand still while the robot moves.

#include "oted/data/checks.h"

namespace oted {

void CheckFrozen(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
