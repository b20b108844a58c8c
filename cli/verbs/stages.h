#pragma once
/// One command per stage, on the same run directory. Each command runs missing earlier stages first.

#include "cli/program.h"

namespace oted::cli {

void AddStageVerbs(Program& program);

}  // namespace oted::cli
