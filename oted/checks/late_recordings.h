#pragma once
/// Recordings whose actions stand in other rows than those of the rest.

#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/data/finding.h"
#include "oted/sim/one_step.h"
#include "oted/sim/simulator.h"

namespace oted {

/// "the action 2 row(s) before explains a row better than its own: error 0.1 instead of 0.9"
std::string ShiftInWords(const ActionShift& better);

/// Needs spec().can_set_state and finite data that fit the task.
/// @param max_rows  of all recordings together that are stepped
void CheckLateRecordings(const SimulatorFactory& factory, const Dataset& dataset, int max_rows, int n_threads,
                         std::vector<Finding>& findings);

}  // namespace oted
