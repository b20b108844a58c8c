#pragma once
/// What a run found, as a page to read and as data: reads a run directory's results, makes none.

#include <filesystem>

namespace oted {

/// Writes report.json (schema `oted.report/1`: everything the page shows) and report.html, one file that opens without
/// a network, into `folder`. A directory in which only some stages are complete gives the sections that are there.
///
/// The page embeds plotly.js from the file that the environment variable OTED_PLOTLY_JS names, else from the one that
/// FoundPackages() has (package_folders.h).
/// @throws UsageError where the directory holds no results; DataError when a result file is damaged or of another
///   schema, plotly.js is missing, or the files cannot be written
void WriteReport(const std::filesystem::path& run_dir, const std::filesystem::path& folder);
/// Into the run directory itself.
void WriteReport(const std::filesystem::path& run_dir);

/// For the beginning of long work that ends with a report. @throws DataError when plotly.js is missing
void CheckReportCanBeMade();

}  // namespace oted
