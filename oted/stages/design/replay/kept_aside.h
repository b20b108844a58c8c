#pragma once
/// Logs to fit and logs to judge by.

#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/matching/held_out.h"

namespace oted {

/// Whole episodes, as HoldOut has it, where there are five or more. Each recording may be of another kind of motion,
/// so every fifth block of two seconds of the others is kept aside as well, where they last 3.5 seconds; where episodes
/// are fewer, of each. Of an episode shorter than ten seconds it is the last fifth.
/// @param period_s  control period [s]
HeldOutParts KeepAside(const Dataset& dataset, double period_s, RngKey key);

}  // namespace oted
