#pragma once
/// Which numbers of a model are worth a doubt, given what the logs show.

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/sim/mujoco/model_outline.h"
#include "oted/sim/simulator.h"

namespace oted {

struct ParameterChoice {
  std::vector<ParameterSpec> chosen;
  std::vector<std::string> left_out;  ///< "name: why", a line each
};

/// Dry friction, damping, armature, strength of the drives, masses, contact friction and the delay of actions: of each
/// joint where few move, otherwise of all at once. Ranges are multiples of nominal, or go up to what the logs can mean
/// where the model has nothing: a share of the forces that acted, at the speeds that were reached. What hardly changes
/// the logged episodes, or changes them just as another one does, is left out.
/// @param remake  the task's simulators with these parameters
ParameterChoice ChooseParameters(
    const SimulatorFactory& nominal, const Dataset& dataset, const ModelOutline& model, RngKey key,
    const RunContext& context,
    const std::function<std::unique_ptr<SimulatorFactory>(const std::vector<ParameterSpec>&)>& remake);

}  // namespace oted
