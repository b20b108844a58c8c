#pragma once
/// oted collect: demonstrations of a policy in a target. oted behavior: the policies themselves.

#include "cli/program.h"

namespace oted::cli {

void AddCollectVerb(Program& program);
void AddBehaviorVerb(Program& program);

}  // namespace oted::cli
