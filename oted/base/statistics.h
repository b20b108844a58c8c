#pragma once
/// Means, deviations and medians. Sums run in the order of the numbers.

#include <span>
#include <vector>

namespace oted {

/// The arithmetic mean; 0 for none.
double Mean(std::span<const double> values);

/// The standard deviation with n - 1 in the denominator; 0 for fewer than two values.
double StandardDeviation(std::span<const double> values);

/// The middle one; of an even count the upper of the two. 0 for none.
double Median(std::vector<double> values);

}  // namespace oted
