#pragma once
/// Checks of rows and episodes.

#include <vector>

#include "oted/data/checks.h"

namespace oted {

/// Rows and episodes: duplicates, rows that stand still, missed boundaries, jumps, lengths, amount.
void CheckRows(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
