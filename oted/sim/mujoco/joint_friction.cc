#include "oted/sim/mujoco/joint_friction.h"

#include <mujoco/mjbatch.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "oted/base/error.h"

namespace oted {
namespace {
constexpr double kSlowest = 1e-9;  // [m/s, rad/s]: a range may hold 0
}  // namespace

bool IsFrictionArray(const std::string& array) {
  return std::ranges::any_of(kFrictionArrays, [&](const FrictionArray& own) { return array == own.name; });
}

bool ReachesJointArray(const std::string& path, const std::string& array) {
  const std::string field = "/" + array.substr(std::string("dof_").size());
  for (size_t at = path.find(field); at != std::string::npos; at = path.find(field, at + 1)) {
    const size_t end = at + field.size();
    if (end == path.size() || path[end] == '[' || path[end] == ' ') return true;
  }
  return false;
}

bool IsFrictionPath(const std::string& path) {
  return std::ranges::any_of(kFrictionArrays,
                             [&](const FrictionArray& own) { return ReachesJointArray(path, own.name); });
}

JointFriction::JointFriction(mjBatch* batch, bool loaded)
    : batch_(batch), loaded_(loaded), nv_(static_cast<int>(mjb_model(batch)->nv)), n_state_(mjb_nstate(batch)) {
  const int n_lanes = mjb_nsim(batch);
  frictionloss_ = static_cast<double*>(mjb_expand(batch, "dof_frictionloss", nullptr, nullptr));
  velocities_ = mjb_stateComponent(batch, mjSTATE_QVEL, nullptr);
  OTED_CHECK(frictionloss_ != nullptr && velocities_ != nullptr);
  base_ = load_ = Array2<double>(n_lanes, nv_);
  for (int lane = 0; lane < n_lanes; ++lane) {
    std::copy_n(mjb_model(batch)->dof_frictionloss, nv_, base_.row(lane).begin());
  }
  for (size_t q = 0; q < values_.size(); ++q) {
    values_[q] = Array2<double>(n_lanes, nv_);
    std::ranges::fill(values_[q].values(), kFrictionArrays[q].nominal);
  }
}

double* JointFriction::Values(const std::string& array) {
  for (size_t q = 0; q < values_.size(); ++q) {
    if (array == kFrictionArrays[q].name) return values_[q].data();
  }
  OTED_CHECK(array == "dof_frictionloss");
  return base_.data();
}

bool JointFriction::GrowsWithLoad(int lane) const {
  return std::ranges::any_of(values_[kLoadFriction].row(lane), [](double value) { return value != 0; });
}

void JointFriction::Rest(int lane) {
  std::ranges::fill(load_.row(lane), 0.0);
  Write(lane);
}

void JointFriction::Write(int lane) {
  const double* velocity = velocities_ + static_cast<ptrdiff_t>(lane) * n_state_;
  double* frictionloss = frictionloss_ + static_cast<ptrdiff_t>(lane) * nv_;
  for (int dof = 0; dof < nv_; ++dof) {
    const double speed = velocity[dof] / std::max(kSlowest, values_[kStribeckVelocity](lane, dof));
    const double more = values_[kStribeckTorque](lane, dof) * std::exp(-speed * speed) +
                        values_[kLoadFriction](lane, dof) * std::abs(load_(lane, dof));
    // Where the physics broke down only the base is left.
    frictionloss[dof] = std::max(0.0, base_(lane, dof) + (std::isfinite(more) ? more : 0.0));
  }
}

void JointFriction::TakeLoad(const mjModel* model, mjData* data, int lane, void* self) {
  mj_fwdPosition(model, data);
  mj_fwdVelocity(model, data);
  mj_fwdActuation(model, data);
  auto& load = static_cast<JointFriction*>(self)->load_;
  std::copy_n(data->qfrc_actuator, model->nv, load.row(lane).begin());
}

int JointFriction::Prepare(std::span<const int> lanes) {
  std::vector<int> loaded;
  if (loaded_)
    std::ranges::copy_if(lanes, std::back_inserter(loaded), [this](int lane) { return GrowsWithLoad(lane); });
  const int n = static_cast<int>(loaded.size());
  const int n_failed = n > 0 ? mjb_apply(batch_, loaded.data(), n, TakeLoad, this, 0) : 0;
  for (const int lane : lanes) Write(lane);
  return n_failed;
}

}  // namespace oted
