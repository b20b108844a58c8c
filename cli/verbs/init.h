#pragma once
/// oted init: a first task file from a model and logs.

#include "cli/program.h"

namespace oted::cli {

void AddInitVerb(Program& program);

}  // namespace oted::cli
