#pragma once
/// design.method = "auto": other methods are tried where that of the first predicts no better than the nominal one
/// (oted/stages/design/method_choice.h).

#include <vector>

#include "oted/run/design_step.h"
#include "oted/run/run_setup.h"
#include "oted/stages/design/method_choice.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

/// Of every setting whose method was left to auto, the method and why.
/// @param candidates, result  the designs by the first methods, and their scores
std::vector<MethodChoice> ChooseMethods(const RunSetup& run, const std::vector<Candidate>& candidates,
                                        const SelectionResult& result, const CloneSource& clone);

}  // namespace oted
