#pragma once
/// Which numbers a log may hold.

#include <cmath>

namespace oted {

/// The largest: above the nanoseconds of any clock. Beside larger ones all else is rounding.
inline constexpr double kLargestLogged = 1e20;

/// Whether a number is finite and not larger.
inline bool IsLoggable(double value) { return std::abs(value) <= kLargestLogged; }

}  // namespace oted
