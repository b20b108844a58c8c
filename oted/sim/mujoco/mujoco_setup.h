#pragma once
/// What all simulators of one task and parameter space share, read-only.

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "oted/sim/mujoco/driven_activations.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/model_field.h"
#include "oted/sim/mujoco/task_rules.h"
#include "oted/sim/simulator.h"

namespace oted {

struct MujocoSetup {
  std::filesystem::path model_path;
  LoadedModel loaded;
  SimulatorSpec spec;
  std::string why_not_settable;  ///< "" where spec.can_set_state
  ParameterSpace space;
  std::vector<ModelField> fields;        ///< of all parameters
  std::vector<double> start_state;       ///< mj_getState(mjSTATE_INTEGRATION) that every start begins from
  int frame_skip = 1;                    ///< physics steps per control step
  std::vector<int> controls;             ///< entry of mjData's ctrl for every action
  std::vector<DrivenActivation> driven;  ///< activations that no observation shows
  std::function<std::unique_ptr<TaskRules>()> make_rules;
};

/// One of Gymnasium's tasks. @throws UsageError, DataError
std::shared_ptr<const MujocoSetup> MakeMujocoSetup(const std::string& task, std::vector<ParameterSpec> specs);

/// Compiles the model again where a parameter moves what MuJoCo would refuse to move. Before anything refers to it.
/// @throws UsageError, DataError
void LetInertiaMove(const std::vector<ParameterSpec>& specs, LoadedModel& loaded);

/// Resolves the parameters against `setup.loaded` and fills in what depends on them. @throws UsageError
void AddParameters(std::vector<ParameterSpec> specs, MujocoSetup& setup);

/// The state after mj_resetData, or of keyframe `key` from 0 on.
std::vector<double> FixedState(const mjModel& model, int key = -1);

/// SimulatorSpec::step_weight, by what a step does: a walker of nine degrees of freedom by RK4, and less, weighs 1.
double StepWeight(const mjModel& model);

}  // namespace oted
