#pragma once
/// The time between rows, by how far positions move over many rows: exact to a percent where single rows are noisy.

#include <optional>
#include <vector>

#include "oted/data/dataset.h"

namespace oted {

/// Seconds per row by the sums of velocities over stretches of rows and how far positions move there. What sensors add
/// to single readings, and a lag or filter of a few rows, hardly touches these; an offset does not.
/// @param velocities  those that are asked, with a position in `rate_of`
/// @return the median over velocities; none where fewer than two tell it, or not half of them, or where they differ
std::optional<double> PeriodByStretches(const Dataset& dataset, const std::vector<int>& rate_of,
                                        const std::vector<int>& velocities);

}  // namespace oted
