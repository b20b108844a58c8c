#pragma once
/// The results of a design in the formats that other tools read: the designed simulator as MJCF, the mixture q(z) as
/// JSON, the parameters as a file of mujoco.sysid (docs/file_formats.md, "Exports").

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace oted {

/// What to write; an empty path is not written.
struct ExportRequest {
  std::filesystem::path mjcf;
  std::filesystem::path q;
  std::filesystem::path sysid;
  /// Which seed's mode the MJCF file holds: "best" (the best-scoring seed), a seed's number, or "all": one file for
  /// each seed of the selected setting, its number added to the name (designed-1.xml).
  std::string member = "best";
};

/// One written file.
struct ExportedFile {
  std::string what;  ///< "designed model, seed 2"
  std::filesystem::path path;
};

/// Keeps a run from exporting, without being asked, a design that predicts no better than the nominal model.
/// @throws DataError where the design does not surely predict better, and either is outside the family, or is no gap
/// and its error is a tenth larger than the nominal model's at some horizon
void CheckIsWorthExporting(const std::filesystem::path& run_directory);

/// Everything into `run_directory`/export: designed.xml, q.json, parameters.yaml.
ExportRequest DefaultExports(const std::filesystem::path& run_directory);

/// Reads run.toml, design.json and the selected setting's q.json files, and writes what is asked. The same run gives
/// the same bytes: no clock and no path of the run stands in the files; folders of a model's meshes do.
/// @throws UsageError when there is no design yet or no such member; DataError when the directory's files do not belong
/// together, when the model has changed since the design, or when MuJoCo cannot write it (DesignedMjcf).
std::vector<ExportedFile> Export(const std::filesystem::path& run_directory, const ExportRequest& request);

/// What the designed model that the default request wrote lacks, and what that means: "without zero, lag, which ...".
/// The simulators and environments of the run have it. Empty where it lacks nothing.
std::string WhatExportedModelLacks(const std::filesystem::path& run_directory);

/// Removes what the default request writes.
void RemoveExports(const std::filesystem::path& run_directory);

}  // namespace oted
