#include "oted/sim/mujoco/version.h"

#include <mujoco/mujoco.h>

namespace oted {

std::string MujocoVersion() { return mj_versionString(); }

}  // namespace oted
