#include "oted/sim/mujoco/model_scale.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

namespace oted {
namespace {
constexpr double kGravity = 9.81;  // [m/s^2]
}  // namespace

double RoundBound(double value) {
  const double decade = std::pow(10, std::floor(std::log10(std::max(value, 1e-9))));
  for (const double digit : {1.0, 2.0, 5.0}) {
    if (digit * decade >= value) return digit * decade;
  }
  return 10 * decade;
}

double HoldingTorque(const mjModel& model) { return model.stat.meanmass * kGravity * model.stat.extent; }

}  // namespace oted
