#pragma once
/// Stage 5 of a run: the best of the agents, judged in every designed simulator.

#include "oted/run/agents_step.h"
#include "oted/run/policy_records.h"
#include "oted/run/run_setup.h"
#include "oted/run/selection_step.h"

namespace oted {

/// policy_selection.json, and the selected agent's policy.onnx on top of the run.
PolicySelectionRecord SelectAgent(const RunSetup& run, const SelectedDesign& design, const Agents& agents);

}  // namespace oted
