#pragma once
/// A study's last step: every policy in the target. Nothing else of a run looks at the truth.

#include "oted/run/agents_step.h"
#include "oted/run/policy_records.h"
#include "oted/run/run_setup.h"
#include "oted/run/selection_step.h"

namespace oted {

/// evaluation.json. The truth must be known.
EvaluationRecord Evaluate(const RunSetup& run, const SelectedDesign& design, const Agents& agents, const Policy& clone,
                          const PolicySelectionRecord& selection);

}  // namespace oted
