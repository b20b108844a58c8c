#pragma once
/// Means and deviations of a few numbers, summed in their order.

#include <span>

namespace oted {

/// The arithmetic mean; 0 for none.
double Mean(std::span<const double> values);

/// The standard deviation with n - 1 in the denominator; 0 for fewer than two values.
double StandardDeviation(std::span<const double> values);

}  // namespace oted
