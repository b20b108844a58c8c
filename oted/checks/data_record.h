#pragma once
/// What `oted data` prints as JSON, and what a conversion lost.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/checks/data_check.h"
#include "oted/data/describe.h"

namespace oted {

/// oted.data_check/1 and oted.data_info/1 (docs/file_formats.md). `spec` may be null.
nlohmann::json DataCheckRecord(const Dataset& dataset, const SimulatorSpec* spec, const DataCheck& check);
nlohmann::json DataInfoRecord(const Dataset& dataset, const SimulatorSpec* spec, const DatasetSummary& summary);

/// What writing `wanted` and reading it back as `got` changed, one sentence each; empty when nothing.
std::vector<std::string> Losses(const Dataset& wanted, const Dataset& got);

}  // namespace oted
