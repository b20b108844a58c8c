#pragma once
/// More formats for fuzzing.h: policies as ONNX, parameter files, models and tasks, checkpoints, and records of a run.

#include <filesystem>
#include <vector>

#include "tests/fuzz/fuzzing.h"

namespace oted {

/// Makes their seeds in `folder`.
void AddModelFormats(const std::filesystem::path& folder, std::vector<FuzzFormat>& formats);

}  // namespace oted
