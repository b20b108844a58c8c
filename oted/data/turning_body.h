#pragma once
/// Where a body that turns in space is seen.

#include <array>

namespace oted {

/// The observations of a free or a ball joint; -1 where there is none.
struct TurningBody {
  std::array<int, 4> orientation = {-1, -1, -1, -1};  ///< quaternion w, x, y, z
  std::array<int, 3> turn = {-1, -1, -1};             ///< angular velocity [rad/s], about the body's own axes
  std::array<int, 3> position = {-1, -1, -1};         ///< [m], of a free joint
  std::array<int, 3> velocity = {-1, -1, -1};         ///< [m/s], along the world's axes
};

}  // namespace oted
