#pragma once
/// A dataset as CSV (docs/file_formats.md).

#include <string>

#include "oted/data/dataset.h"

namespace oted {

/// Writes what ReadCsv gives back to the last bit: one row per transition and one for each final observation, names as
/// "obs.NAME" and "act.NAME". .csv.gz is compressed. @throws DataError, also when s' is not the next row's s.
void WriteCsv(const Dataset& dataset, const std::string& path);
/// What that writes: equal datasets give equal bytes.
std::string CsvBytes(const Dataset& dataset, const std::string& path);

}  // namespace oted
