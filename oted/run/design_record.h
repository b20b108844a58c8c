#pragma once
/// design.json (schema oted.design/1, docs/file_formats.md): what the design found and how far to trust it.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/config/run_config.h"
#include "oted/stages/design/method_choice.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

/// Parameters with modes, spreads, intervals and verdicts over the selected setting's seeds; the mixture that agents
/// train in; every setting's scores; the verdict on the whole. Where another method took the place of trajectories, the
/// verdict, the channels and the suspects are still those of the fit, which tells them.
/// @param choices     of the settings whose method was left to auto
/// @param has_effect  per parameter, whether it changes anything that the logs show
/// @param channels    names of the observation's numbers; may be empty
nlohmann::json DesignRecord(const RunConfig& config, const ParameterSpace& space,
                            const std::vector<Candidate>& candidates, const SelectionResult& result,
                            const std::vector<MethodChoice>& choices, const std::vector<bool>& has_effect,
                            const std::vector<std::string>& channels);

}  // namespace oted
