#pragma once
/// The page of a study over many runs: curves with bands, and a table. One file that opens without a network.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

namespace oted {

/// Writes `path` atomically from plain text and numbers:
///
///   {"title", "headline", "text": [paragraphs],
///    "panels": [{"title", "x": axis title,
///                "lines": [{"name", "steps", "median", "low", "high", "level"}]}],
///    "level_name", "columns": [names], "rows": [[texts]]}
///
/// Lines of the same name have the same colour in every panel; at most four names are told apart. `level` is a
/// value to compare the curve's end with, drawn as a dashed line; it may be missing.
/// @throws DataError when plotly.js is missing or the file cannot be written
void WriteStudyPage(const nlohmann::json& study, const std::filesystem::path& path);

}  // namespace oted
