#include "oted/sim/mujoco/place.h"

#include <cmath>
#include <optional>

namespace oted {
namespace {

constexpr double kPerpendicular = 1e-9;

struct Direction {
  mjtNum axis[3];  // in the world
};

/// The direction in which a coordinate moves the whole model; none where it does not, or where a spring, a limit or an
/// actuator holds it in its place.
std::optional<Direction> DirectionOf(const mjModel& model, int qpos) {
  for (int joint = 0; joint < model.njnt; ++joint) {
    const int k = qpos - model.jnt_qposadr[joint], body = model.jnt_bodyid[joint], type = model.jnt_type[joint];
    if (k < 0 || k >= (type == mjJNT_FREE ? 3 : 1) || (type != mjJNT_FREE && type != mjJNT_SLIDE)) continue;
    if (model.body_parentid[body] != 0 || model.jnt_limited[joint]) return std::nullopt;
    if (type == mjJNT_SLIDE && model.jnt_stiffness[joint] != 0) return std::nullopt;
    // A hinge before it would turn its axis.
    for (int other = model.body_jntadr[body]; other < joint; ++other) {
      if (model.jnt_type[other] != mjJNT_SLIDE) return std::nullopt;
    }
    for (int i = 0; i < model.nactuator; ++i) {
      const int kind = model.actuator_trntype[i];
      const bool on_joint = kind == mjTRN_JOINT || kind == mjTRN_JOINTINPARENT;
      if (on_joint && model.actuator_trnid[2 * i] == joint) return std::nullopt;
    }
    Direction direction{};
    if (type == mjJNT_FREE) {
      direction.axis[k] = 1;
    } else {
      mju_rotVecQuat(direction.axis, model.jnt_axis + 3 * joint, model.body_quat + 4 * body);
    }
    return direction;
  }
  return std::nullopt;
}

}  // namespace

bool IsPlace(const mjModel& model, int qpos) {
  if (model.ntree != 1 || model.neq > 0 || model.ntendon > 0 || model.nflex > 0) return false;
  const std::optional<Direction> direction = DirectionOf(model, qpos);
  if (!direction) return false;
  for (int geom = 0; geom < model.ngeom; ++geom) {
    const int body = model.geom_bodyid[geom];
    const bool collides = model.geom_contype[geom] != 0 || model.geom_conaffinity[geom] != 0 || model.npair > 0;
    if (model.body_weldid[body] != 0 || !collides) continue;
    if (body != 0 || model.geom_type[geom] != mjGEOM_PLANE) return false;
    const mjtNum up[3] = {0, 0, 1};
    mjtNum normal[3];
    mju_rotVecQuat(normal, up, model.geom_quat + 4 * geom);
    if (std::abs(mju_dot3(normal, direction->axis)) > kPerpendicular) return false;
  }
  return true;
}

}  // namespace oted
