#pragma once
/// oted validate: how a finished design predicts recordings that came later.

#include "cli/program.h"

namespace oted::cli {

void AddValidateVerb(Program& program);

}  // namespace oted::cli
