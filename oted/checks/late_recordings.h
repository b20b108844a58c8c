#pragma once
/// Recordings whose actions stand in other rows than those of the rest.

#include <vector>

#include "oted/data/dataset.h"
#include "oted/data/finding.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Needs spec().can_set_state and finite data that fit the task.
/// @param max_rows  of all recordings together that are stepped
void CheckLateRecordings(const SimulatorFactory& factory, const Dataset& dataset, int max_rows, int n_threads,
                         std::vector<Finding>& findings);

}  // namespace oted
