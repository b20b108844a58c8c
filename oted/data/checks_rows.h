#pragma once
/// Checks of rows and episodes.

#include <vector>

#include "oted/data/checks.h"

namespace oted {

/// Fewer transitions tell little: scores are measured on held-out halves.
inline constexpr int kFewTransitions = 200;

/// Rows and episodes: duplicates, rows that stand still, missed boundaries, jumps, lengths, amount.
void CheckRows(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
