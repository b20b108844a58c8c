#pragma once
/// Stage 3 of a run: the best setting h, and the record of what the design found.

#include <vector>

#include "oted/matching/designer.h"
#include "oted/nn/policy.h"
#include "oted/run/design_record.h"
#include "oted/run/design_step.h"
#include "oted/run/run_setup.h"

namespace oted {

struct SelectedDesign {
  DesignRecord record;
  std::vector<Designer> q;  ///< of record.mixture
};

/// design.json. A setting whose method was left to auto may be designed by another method on the way.
/// @param designs  of every setting
SelectedDesign SelectDesign(RunSetup& run, std::vector<Design> designs, const CloneSource& clone);

}  // namespace oted
