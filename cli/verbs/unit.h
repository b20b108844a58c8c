#pragma once
/// oted unit PLAN --index I: one unit of a plan, by a child program that runs its command.

#include "cli/program.h"

namespace oted::cli {

void AddUnitVerb(Program& program);

}  // namespace oted::cli
