#pragma once
/// Checks of velocities against the positions whose rates they are.

#include "oted/data/checks.h"
#include "oted/data/rate_agreement.h"

namespace oted {

/// Positions that are kept within one turn.
void CheckWraps(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

/// Positions that go farther in a typical row than any robot does (kImpossibleMotion).
void CheckJumps(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

/// Angles that go so far in a typical row that they are hardly radians.
void CheckTurns(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

/// Signs, units, lags, swapped columns, the control rate.
/// @param elsewhere  velocities that another check has explained (checks_turning.h)
void CheckRates(const Dataset& dataset, const TaskFacts& facts, const std::vector<int>& elsewhere,
                std::vector<Finding>& findings);

}  // namespace oted
