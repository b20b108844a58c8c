#pragma once
/// The terms of a joint's residual force, by the index of their weight (oted/sim/mujoco/joint_residual.h).

#include <array>

namespace oted {

/// What a weight is called in a parameter's name.
inline constexpr std::array<const char*, 7> kResidualTerms = {"constant", "sin",       "cos", "sin2",
                                                              "cos2",     "direction", "drag"};

}  // namespace oted
