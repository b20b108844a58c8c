#include "oted/sim/mujoco/model_scale.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "oted/sim/mujoco/tendon_joints.h"

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
    const std::vector<TendonJoint> joints = JointsOfTendon(model, tendon);
    if (joints.empty()) most = std::max(most, weight);  // spatial: its length is one
    for (const TendonJoint& joint : joints) {
      if (joint.coefficient == 0) continue;
      const bool turns = model.jnt_type[joint.id] == mjJNT_HINGE;
      most = std::max(most, (turns ? HoldingTorque(model) : weight) / std::abs(joint.coefficient));
    }
  }
  return most;
}

}  // namespace oted
