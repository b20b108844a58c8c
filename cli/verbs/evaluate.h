#pragma once
/// oted evaluate: every policy of a study in its target, or, with --policy, one policy file in one simulator.

#include "cli/program.h"

namespace oted::cli {

void AddEvaluateVerb(Program& program);

}  // namespace oted::cli
