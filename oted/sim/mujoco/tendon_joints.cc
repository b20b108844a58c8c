#include "oted/sim/mujoco/tendon_joints.h"

namespace oted {

std::vector<TendonJoint> JointsOfTendon(const mjModel& model, int tendon) {
  std::vector<TendonJoint> joints;
  const int first = model.tendon_adr[tendon];
  for (int w = first; w < first + model.tendon_num[tendon]; ++w) {
    if (model.wrap_type[w] == mjWRAP_JOINT) joints.push_back({model.wrap_objid[w], model.wrap_prm[w]});
  }
  return joints;
}

}  // namespace oted
