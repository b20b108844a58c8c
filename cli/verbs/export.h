#pragma once
/// oted export: the results of a design in other tools' formats.

#include <filesystem>

#include "cli/program.h"

namespace oted::cli {

void AddExportVerb(Program& program);

/// Writes RUN_DIR/export/ when there is a design; what cannot be exported is a warning on stderr.
void WriteExports(const std::filesystem::path& run_directory);

}  // namespace oted::cli
