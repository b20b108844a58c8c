#pragma once
/// What a fixed tendon is made of.

#include <mujoco/mujoco.h>

#include <vector>

namespace oted {

struct TendonJoint {
  int id;              ///< of the joint
  double coefficient;  ///< by which its position adds to the tendon's length
};

/// In the order of the model; none of a spatial tendon.
std::vector<TendonJoint> JointsOfTendon(const mjModel& model, int tendon);

}  // namespace oted
