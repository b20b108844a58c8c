#pragma once
/// Checks of single channels.

#include <span>
#include <vector>

#include "oted/data/checks.h"

namespace oted {

/// Single channels: constant, clipped, outside their bounds, quantised, half precision.
void CheckChannels(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

/// The step of the grid on which all of these values lie, as an encoder's do; 0 where they lie on none.
double GridStep(std::span<const double> values);

}  // namespace oted
