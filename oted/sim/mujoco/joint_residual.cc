#include "oted/sim/mujoco/joint_residual.h"

#include <mujoco/mjbatch.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/sim/mujoco/joint_friction.h"
#include "oted/sim/mujoco/model_scale.h"

namespace oted {
namespace {
constexpr double kReach = 0.2;  // of the force that is known of a joint
}  // namespace

double ResidualReach(const mjModel& model) {
  double force = 0;
  for (int a = 0; a < model.nactuator; ++a) {
    if (!model.actuator_forcelimited[a]) continue;
    force = std::max(force,
                     std::abs(model.actuator_gear[6 * a]) * std::max(std::abs(model.actuator_forcerange[2 * a]),
                                                                     std::abs(model.actuator_forcerange[2 * a + 1])));
  }
  if (force == 0) force = HoldingTorque(model);
  return RoundBound(kReach * force);
}

bool IsResidualPath(const std::string& path) { return ReachesJointArray(path, kResidualArray); }

JointResidual::JointResidual(mjBatch* batch)
    : batch_(batch), nv_(static_cast<int>(mjb_model(batch)->nv)), n_state_(mjb_nstate(batch)) {
  const mjModel& model = *mjb_model(batch);
  position_.assign(static_cast<size_t>(nv_), -1);
  for (int joint = 0; joint < model.njnt; ++joint) {
    if (model.jnt_type[joint] != mjJNT_SLIDE && model.jnt_type[joint] != mjJNT_HINGE) continue;
    position_[static_cast<size_t>(model.jnt_dofadr[joint])] = model.jnt_qposadr[joint];
  }
  positions_ = mjb_stateComponent(batch, mjSTATE_QPOS, nullptr);
  velocities_ = mjb_stateComponent(batch, mjSTATE_QVEL, nullptr);
  applied_ = mjb_stateComponent(batch, mjSTATE_QFRC_APPLIED, nullptr);
  OTED_CHECK(positions_ != nullptr && velocities_ != nullptr && applied_ != nullptr);
  weights_ = Array2<double>(mjb_nsim(batch), nv_ * kResidualSize);
}

void JointResidual::Write(int lane) {
  const ptrdiff_t first = static_cast<ptrdiff_t>(lane) * n_state_;
  for (int dof = 0; dof < nv_; ++dof) {
    const double* w = weights_.row(lane).data() + static_cast<ptrdiff_t>(dof) * kResidualSize;
    const int at = position_[static_cast<size_t>(dof)];
    const double q = at < 0 ? 0 : positions_[first + at], v = velocities_[first + dof];
    const double force = w[0] + w[1] * std::sin(q) + w[2] * std::cos(q) + w[3] * std::sin(2 * q) +
                         w[4] * std::cos(2 * q) + w[5] * std::tanh(v) + w[6] * v * std::abs(v);
    // Where the physics broke down there is none.
    applied_[first + dof] = std::isfinite(force) ? force : 0;
  }
}

}  // namespace oted
