#pragma once
/// What a run was asked for, kept beside its results.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/run/run_setup.h"

namespace oted {

/// run.toml, dataset.json and model/, each written where it is not there already. run.toml can be run again from its
/// place.
void WriteProvenance(const RunSetup& run);

/// The settings that differ from those of the directory's run.toml, each as "design.grow = true (was false)"; without
/// files, which may be the same at another path. None where there is no run.toml that can be read.
std::vector<std::string> ChangedSettings(const RunSetup& run);

/// A run directory's own run.toml. @throws DataError when it is not as it was written: an edit cannot be told from
/// damage, and the error says how an edited one is run
RunConfig ReadKeptConfig(const std::filesystem::path& run_directory);

}  // namespace oted
