#pragma once
/// The brief fit that proposed parameters are chosen by, with ranges as wide as it asks for.

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "oted/base/log.h"
#include "oted/base/rng.h"
#include "oted/checks/trial_fit.h"
#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

inline constexpr double kMostDelay = 10;  ///< [control steps] that are searched
inline constexpr const char* kDelayPath = "action/delay";

/// Fits the candidates briefly (FitBriefly). A range at whose end the fit ends, from nothing to a rough guess or of
/// multiples, is widened in place, and the fit made again, twice at most.
/// @param remake  the simulators of such parameters
std::optional<TrialFit> FitWidened(
    std::vector<ParameterSpec>& candidates, const Dataset& dataset, RngKey key, const RunContext& context,
    const std::function<std::unique_ptr<SimulatorFactory>(const std::vector<ParameterSpec>&)>& remake);

}  // namespace oted
