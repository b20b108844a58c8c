#pragma once
/// Runs that differ in settings, data and seeds.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/config/run_config.h"
#include "oted/plan/collected.h"

namespace oted {

/// What determines the result of a run: settings, model and data by content, and not where they lie, nor threads.
/// @param command  "design" or "run"
nlohmann::json SweepIdentity(const RunConfig& config, const std::string& command, const std::string& data_sha256);

/// A row for each finished run: its labels, verdict, parameters; with a truth, errors and returns. A parameter or
/// return that a run does not have is empty.
struct SweepTable {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;

  /// Reads the runs in UNIT/result. @throws DataError where one is damaged
  static SweepTable Of(const std::vector<CollectedUnit>& units);
  std::string Csv() const;
  /// As Markdown, with numbers rounded.
  std::string Text() const;
};

}  // namespace oted
