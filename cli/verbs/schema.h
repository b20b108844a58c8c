#pragma once
/// oted schema: what a task file may hold, for editors.

#include "cli/program.h"

namespace oted::cli {

void AddSchemaVerb(Program& program);

}  // namespace oted::cli
