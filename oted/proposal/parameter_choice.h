#pragma once
/// Which numbers of a model are worth a doubt, given what the logs show.

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/sim/mujoco/model_outline.h"
#include "oted/sim/simulator.h"

namespace oted {

struct ParameterChoice {
  /// What is not freed.
  struct LeftOut {
    std::string why;  ///< "name (field): ..."
    /// Where it moves the logs as others do: what may be freed in the place of one of them.
    std::optional<ParameterSpec> alternative = std::nullopt;
  };

  std::vector<ParameterSpec> chosen;
  std::vector<LeftOut> left_out;
};

/// Of ParameterCandidates those that the logs tell. What hardly changes the logged episodes, or changes them just as
/// another one does, is left out.
/// @param remake  the task's simulators with these parameters
ParameterChoice ChooseParameters(
    const SimulatorFactory& nominal, const Dataset& dataset, const ModelOutline& model, RngKey key,
    const RunContext& context,
    const std::function<std::unique_ptr<SimulatorFactory>(const std::vector<ParameterSpec>&)>& remake);

}  // namespace oted
