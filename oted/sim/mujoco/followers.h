#pragma once
/// Joints that an equality ties to others: the second finger of a gripper, a parallel linkage.

#include <mujoco/mujoco.h>

#include <array>
#include <functional>
#include <vector>

#include "oted/sim/mujoco/observables.h"
#include "oted/sim/mujoco/task_rules.h"

namespace oted {

/// A hinge or slide whose position is a polynomial of another one's, or is held. Entries of qpos and qvel.
struct Follower {
  int qpos = 0, dof = 0;
  int leader_qpos = -1, leader_dof = -1;  ///< -1: it is held
  double at = 0, leader_at = 0;           ///< positions in the model's reference pose
  /// (position - at) by (leader's position - leader_at), from the constant to the fourth power, as equality/joint has
  /// it.
  std::array<double, 5> polynomial = {};

  bool Sets(StatePart part, int index) const {
    return (part == StatePart::kQpos && index == qpos) || (part == StatePart::kQvel && index == dof);
  }
};

/// Those whose own position is not seen and that follow seen ones, also through others: leaders stand before their
/// followers. An equality that is a line is followed from either end. One that is not active ties nothing.
std::vector<Follower> FollowersOf(const mjModel& model, const std::function<bool(int qpos)>& is_seen);

/// Sets position and velocity as its leader's ask. The constraint's springiness is neglected.
void Follow(const Follower& follower, const LaneState& state);

}  // namespace oted
