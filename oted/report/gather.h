#pragma once
/// Collects a run directory's results into one JSON object, the content of report.json.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

namespace oted {

/// The object has `schema` and `title`, and of the following what the directory holds:
/// - `parameters`: design.json's, each with `truth` and `absolute_error` where an evaluation knows them, and
///   `seed_modes`, the modes of the selected setting's seeds;
/// - `policies`: evaluation.json's; `evaluation`, `design`, `policy_selection`, `dataset`: the files themselves;
/// - `export`: export/export.json, what speaks for the exported files;
/// - `clone`: {result, curves}; `agents`, `nominal`: lists of {name, result, curves}; `baselines`: the same with the
///   baseline's name, `baseline`;
/// - `replay`, `motion`: motion/replay.json and motion.json, which names the pictures beside it;
/// - `shown_setting` and `design_seeds`, a list of {name, q, curves}: the seeds of the selected setting, or,
///   before the selection, of the first one;
/// - `warnings`; `run`: {config, versions}.
/// A curve is a list of [step, value] of at most 1,000 points (curves.csv has them all).
/// @throws UsageError where the directory holds no results, DataError for a file that is damaged or of another schema
nlohmann::json GatherReport(const std::filesystem::path& run_dir);

}  // namespace oted
