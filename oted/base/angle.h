#pragma once
/// Angles are radians inside the program.

#include <numbers>

namespace oted {

inline constexpr double kDegree = std::numbers::pi / 180;  ///< [rad]

}  // namespace oted
