#pragma once
/// Which change of the log would make the model predict it: a sign, a swap of two joints, a zero, a unit.

#include <vector>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/data/finding.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Replays short windows of the log in the nominal simulator, with one correction after another, and reports those with
/// which it predicts the channels concerned far better. Rates that nobody logged are guessed. Needs spec().can_replay()
/// and finite data that fit the task.
/// @param dataset  as CheckDataset found it: channels whose velocities disagree with their positions are corrected one
/// by
///   one, others together
/// @throws Interrupted when a stop was requested
void CheckCorrections(const SimulatorFactory& factory, const Dataset& dataset, const RunContext& context,
                      std::vector<Finding>& findings);

}  // namespace oted
