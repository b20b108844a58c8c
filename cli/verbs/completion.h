#pragma once
/// oted completion: what makes a shell complete commands, options and values.

#include "cli/program.h"

namespace oted::cli {

void AddCompletionVerb(Program& program);

}  // namespace oted::cli
