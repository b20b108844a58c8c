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

/// Of ParameterCandidates those that the logs tell. What hardly changes the logged episodes, or changes them just as
/// another one does, is left out.
/// @param remake  the task's simulators with these parameters
ParameterChoice ChooseParameters(
    const SimulatorFactory& nominal, const Dataset& dataset, const ModelOutline& model, RngKey key,
    const RunContext& context,
    const std::function<std::unique_ptr<SimulatorFactory>(const std::vector<ParameterSpec>&)>& remake);

}  // namespace oted
