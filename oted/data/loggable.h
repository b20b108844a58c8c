#pragma once
/// Which numbers a log may hold.

#include <cmath>

namespace oted {

/// The largest: of larger ones the squares are soon infinite.
inline constexpr double kLargestLogged = 1e100;

/// Whether a number is finite and not larger.
inline bool IsLoggable(double value) { return std::abs(value) <= kLargestLogged; }

}  // namespace oted
