#pragma once
/// oted data info | check | convert: what a log holds, whether it is sound, and the same in another format.

#include "cli/program.h"

namespace oted::cli {

void AddDataVerb(Program& program);

}  // namespace oted::cli
