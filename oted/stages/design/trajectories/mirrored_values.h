#pragma once
/// What a descent from one side does not see: a value that acts as its negative does, such as a centre of mass beside
/// a vertical axis. Not in the paper.

#include <vector>

#include "oted/matching/designer.h"
#include "oted/matching/fit_evidence.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// The parameters whose negative the windows do not surely find less likely, with that other side of their intervals.
/// Each is turned alone, then all of them together.
/// @param fit  after Finish or CovarianceOfParts
/// @param q    what it came to
std::vector<MirroredValue> FindMirrored(const LevelFit& fit, const Designer& q);

}  // namespace oted
