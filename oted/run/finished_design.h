#pragma once
/// A finished design, read from its run directory: what exports and later validations begin with.

#include <filesystem>
#include <string>

#include "oted/config/run_config.h"
#include "oted/run/design_record.h"

namespace oted {

struct FinishedDesign {
  std::filesystem::path folder;
  RunConfig config;
  DesignRecord record;
  size_t best = 0;  ///< of record.mixture
};

/// @throws UsageError where the folder holds no design; DataError for one that is damaged or not that of its run.toml
FinishedDesign ReadDesign(const std::filesystem::path& folder);

/// @throws DataError where `model`, whose hash is `sha256`, is no longer the one that the design was made with
void CheckSameModel(const FinishedDesign& design, const std::string& model, const std::string& sha256);

}  // namespace oted
