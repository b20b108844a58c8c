#pragma once
/// Rows that were lost without a trace in the time.

#include "oted/data/checks.h"

namespace oted {

inline constexpr const char* kMissingRows = "missing_rows";

/// Row changes in which all positions move two or more times as far as their velocities say, where others agree.
void CheckMissingRows(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
