#pragma once
/// Checks of single channels.

#include <vector>

#include "oted/data/checks.h"

namespace oted {

/// Single channels: constant, clipped, outside their bounds, quantised, half precision.
void CheckChannels(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
