#pragma once
/// oted verify: which files of a run directory are as they were written.

#include "cli/program.h"

namespace oted::cli {

void AddVerifyVerb(Program& program);

}  // namespace oted::cli
