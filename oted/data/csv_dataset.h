#pragma once
/// Logs as CSV with a header, one row per control step (docs/file_formats.md).

#include <string>

#include "oted/data/dataset.h"
#include "oted/data/recording.h"

namespace oted {

/// Reads .csv or .csv.gz. An episode ends where its number changes, after a terminal or a timeout, where time runs
/// backwards, and at a gap (oted/data/resample.h). A last row without actions gives the final observation; a last row
/// with actions is dropped with them, as no next row tells where they led.
/// @throws DataError naming file, line and column.
Recording ReadCsv(const std::string& path, const DataOptions& options);

}  // namespace oted
