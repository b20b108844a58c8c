#pragma once
/// Checks of a file's observations against its states.

#include <vector>

#include "oted/data/checks.h"

namespace oted {

/// Observations against infos/qpos and infos/qvel, where the file has them.
void CheckStates(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

}  // namespace oted
