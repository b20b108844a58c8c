#pragma once
/// What all simulators of one task and parameter space share, read-only.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/model_field.h"
#include "oted/sim/mujoco/task.h"
#include "oted/sim/simulator.h"

namespace oted {

struct MujocoSetup {
  MujocoTask task;
  std::filesystem::path model_path;
  LoadedModel loaded;
  SimulatorSpec spec;
  ParameterSpace space;
  std::vector<ModelField> fields;     ///< parallel to the space's parameters
  std::vector<double> default_state;  ///< mj_getState(mjSTATE_INTEGRATION) after mj_resetData
  double control_period = 0;          ///< [s]
};

/// @throws UsageError, DataError
std::shared_ptr<const MujocoSetup> MakeMujocoSetup(const std::string& task, std::vector<ParameterSpec> specs);

}  // namespace oted
