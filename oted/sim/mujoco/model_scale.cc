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

double HoldingTension(const mjModel& model) {
  const double weight = model.stat.meanmass * kGravity;
  double most = 0;
  for (int tendon = 0; tendon < model.ntendon; ++tendon) {
    for (int w = model.tendon_adr[tendon]; w < model.tendon_adr[tendon] + model.tendon_num[tendon]; ++w) {
      const bool is_fixed = model.wrap_type[w] == mjWRAP_JOINT;
      if (is_fixed && model.wrap_prm[w] == 0) continue;
      const bool turns = is_fixed && model.jnt_type[model.wrap_objid[w]] == mjJNT_HINGE;
      const double length_per_move = is_fixed ? std::abs(model.wrap_prm[w]) : 1;
      most = std::max(most, (turns ? HoldingTorque(model) : weight) / length_per_move);
    }
  }
  return most;
}

}  // namespace oted
