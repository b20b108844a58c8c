#include "oted/sim/mujoco/followers.h"

#include <algorithm>
#include <optional>

namespace oted {
namespace {

bool IsScalar(const mjModel& model, int joint) {
  return model.jnt_type[joint] == mjJNT_HINGE || model.jnt_type[joint] == mjJNT_SLIDE;
}

/// `joint` as the equality has it behind `leader`; -1: none.
Follower Behind(const mjModel& model, int joint, int leader, const std::array<double, 5>& polynomial) {
  const int qpos = model.jnt_qposadr[joint];
  Follower follower{.qpos = qpos, .dof = model.jnt_dofadr[joint], .at = model.qpos0[qpos], .polynomial = polynomial};
  if (leader >= 0) {
    follower.leader_qpos = model.jnt_qposadr[leader];
    follower.leader_dof = model.jnt_dofadr[leader];
    follower.leader_at = model.qpos0[follower.leader_qpos];
  }
  return follower;
}

/// A line turned round: none where it is none, or level.
std::optional<std::array<double, 5>> Inverse(const std::array<double, 5>& polynomial) {
  const auto& [constant, slope, square, cube, fourth] = polynomial;
  if (slope == 0 || square != 0 || cube != 0 || fourth != 0) return std::nullopt;
  return std::array<double, 5>{-constant / slope, 1 / slope, 0, 0, 0};
}

/// Both ends of every equality of joints, as followers.
std::vector<Follower> Ties(const mjModel& model) {
  std::vector<Follower> ties;
  for (int i = 0; i < model.neq; ++i) {
    if (model.eq_type[i] != mjEQ_JOINT || model.eq_active0[i] == 0) continue;
    const int joint = model.eq_obj1id[i], leader = model.eq_obj2id[i];
    if (!IsScalar(model, joint) || (leader >= 0 && !IsScalar(model, leader))) continue;
    std::array<double, 5> polynomial = {};
    std::copy_n(model.eq_data + static_cast<ptrdiff_t>(i) * mjNEQDATA, leader >= 0 ? 5 : 1, polynomial.begin());
    ties.push_back(Behind(model, joint, leader, polynomial));
    if (leader < 0) continue;
    if (const auto inverse = Inverse(polynomial)) ties.push_back(Behind(model, leader, joint, *inverse));
  }
  return ties;
}

}  // namespace

std::vector<Follower> FollowersOf(const mjModel& model, const std::function<bool(int qpos)>& is_seen) {
  const std::vector<Follower> ties = Ties(model);
  std::vector<Follower> followers;
  const auto is_known = [&](int qpos) {
    return qpos < 0 || is_seen(qpos) || std::ranges::find(followers, qpos, &Follower::qpos) != followers.end();
  };
  for (bool found = true; found;) {
    found = false;
    for (const Follower& tie : ties) {
      if (is_known(tie.qpos) || !is_known(tie.leader_qpos)) continue;
      followers.push_back(tie);
      found = true;
    }
  }
  return followers;
}

void Follow(const Follower& follower, const LaneState& state) {
  const bool is_held = follower.leader_qpos < 0;
  const double moved = is_held ? 0 : state.qpos[static_cast<size_t>(follower.leader_qpos)] - follower.leader_at;
  double value = 0, slope = 0;
  for (size_t k = follower.polynomial.size(); k-- > 0;) {
    slope = slope * moved + value;
    value = value * moved + follower.polynomial[k];
  }
  state.qpos[static_cast<size_t>(follower.qpos)] = follower.at + value;
  state.qvel[static_cast<size_t>(follower.dof)] =
      is_held ? 0 : slope * state.qvel[static_cast<size_t>(follower.leader_dof)];
}

}  // namespace oted
