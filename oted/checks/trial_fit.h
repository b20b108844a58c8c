#pragma once
/// A brief fit of all parameters that may be off, to see which of them the logs can tell from the others.

#include <optional>
#include <string_view>
#include <vector>

#include "oted/base/array2.h"
#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

struct TrialFit {
  std::vector<double> z;
  /// (d, d): of each two parameters, how alike the logs change with them, at z and with the windows' starts free. 1: in
  /// the same way. 0: no way in common. A parameter that the logs do not show has none in common with any.
  Array2<double> cosines;
};

/// Short windows of the logs, as trajectory matching begins with them
/// (oted/stages/design/trajectories/short_windows.h). Where the nominal model falls over or stands still, what
/// parameters do there says little of what they do in the robot.
/// @param stage  what the progress bar calls it
/// @return none where the simulator cannot be set to logged states, or no window explains anything
std::optional<TrialFit> FitBriefly(const SimulatorFactory& factory, const Dataset& logs, RngKey key,
                                   const RunContext& context, std::string_view stage);

}  // namespace oted
