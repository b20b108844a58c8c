#pragma once
/// What a run was asked for, kept beside its results.

#include <filesystem>

#include "oted/run/run_setup.h"

namespace oted {

/// run.toml, dataset.json and model/, each written where it is not there already. run.toml can be run again from its
/// place.
void WriteProvenance(const RunSetup& run);

/// A run directory's own run.toml. @throws DataError when it is not as it was written: an edit cannot be told from
/// damage, and the error says how an edited one is run
RunConfig ReadKeptConfig(const std::filesystem::path& run_directory);

}  // namespace oted
