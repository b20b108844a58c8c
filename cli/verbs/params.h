#pragma once
/// oted params list: what can be a parameter. oted params check: what the chosen ones mean and do.

#include "cli/program.h"

namespace oted::cli {

void AddParamsVerb(Program& program);

}  // namespace oted::cli
