#pragma once
/// Positions that are commands, or commands that are positions.

#include "oted/data/checks.h"

namespace oted {

/// A position or velocity that follows an action without any error: one was logged in the other's place.
void CheckCopies(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
