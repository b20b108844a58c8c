#pragma once
/// What a run was asked for, kept beside its results.

#include "oted/run/run_setup.h"

namespace oted {

/// run.toml, dataset.json and model/, written anew at each call. run.toml can be run again from its place.
void WriteProvenance(const RunSetup& run);

}  // namespace oted
