#pragma once
/// A task file becomes a simulator: every name in it is resolved here, so that a mistake shows before any work starts.

#include <memory>
#include <vector>

#include "oted/base/array2.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/mujoco/mujoco_setup.h"

namespace oted {

/// @param logged_starts  for start = "logs": first observations of logged episodes
/// @throws UsageError, DataError naming the key, what it got and the remedy
std::shared_ptr<const MujocoSetup> MakeModelSetup(const ModelTask& task, std::vector<ParameterSpec> specs,
                                                  const Array2<double>& logged_starts);

}  // namespace oted
