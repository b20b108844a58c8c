#pragma once
/// What a run found, as a page to read and as data: reads a run directory's results, makes none.

#include <filesystem>

namespace oted {

/// Writes report.json (schema `oted.report/1`: everything the page shows) and report.html, one file that opens without
/// a network, into `run_dir`. A directory in which only some stages are complete gives the sections that are there.
///
/// The page embeds plotly.js from the file that the environment variable OTED_PLOTLY_JS names, else from the one found
/// when the program was built.
/// @throws DataError when the directory holds no results, a result file is damaged or of another schema, plotly.js is
///   missing, or the files cannot be written.
void WriteReport(const std::filesystem::path& run_dir);

}  // namespace oted
