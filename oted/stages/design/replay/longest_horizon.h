#pragma once
/// How far open-loop replays of logs can be followed at all.

#include <optional>
#include <vector>

#include "oted/matching/held_out_prediction.h"
#include "oted/stages/design/replay/prediction_evidence.h"

namespace oted {

/// The longest of 20, 10, 5 and 2 s over which the simulator at problem.z, or at `other`, is off by less than half of a
/// guess's error (HeldOutPrediction::Channel::guess) in the geometric mean over judged channels, and by less than a
/// guess in each (IsNoBetterThanGuess); and the errors there. Of the logs that were kept aside; of those that were
/// learned from, where no others are long enough. At most eight windows, back to back from each episode's start. None
/// where time has no unit, or none can be followed.
/// @param beyond  control steps: only longer horizons are looked for
std::optional<HeldOutPrediction::Horizon> LongestPredicted(const PredictionProblem& problem,
                                                           const std::vector<double>& other, int beyond);

}  // namespace oted
