#pragma once
/// oted run CONFIG.toml: everything.

#include "cli/program.h"

namespace oted::cli {

void AddRunVerb(Program& program);

}  // namespace oted::cli
