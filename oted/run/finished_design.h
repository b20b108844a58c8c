#pragma once
/// A finished design, read from its run directory: what exports and later validations begin with.

#include <filesystem>
#include <string>

#include "oted/config/run_config.h"
#include "oted/run/design_record.h"
#include "oted/sim/simulator.h"

namespace oted {

struct FinishedDesign {
  std::filesystem::path folder;
  RunConfig config;
  DesignRecord record;
  size_t best = 0;  ///< of record.mixture
};

/// @throws UsageError where the folder holds no design; DataError for one that is damaged or not that of its run.toml
FinishedDesign ReadDesign(const std::filesystem::path& folder);

/// @throws DataError where the model that `factory` simulates is no longer the one that the design was made with
void CheckSameModel(const FinishedDesign& design, const SimulatorFactory& factory);

}  // namespace oted
