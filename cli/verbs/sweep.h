#pragma once
/// oted sweep CONFIG: runs that differ in settings, data and seeds, as a plan.

#include "cli/program.h"

namespace oted::cli {

void AddSweepVerb(Program& program);

}  // namespace oted::cli
