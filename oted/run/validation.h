#pragma once
/// How a finished design predicts recordings that came later: `oted validate`.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/run/design_record.h"

namespace oted {

struct ValidationRequest {
  std::filesystem::path run;      ///< run directory that holds a design.json
  std::vector<std::string> data;  ///< recordings of the same task; or a task file that names them, alone
  std::string episodes = "all";   ///< which of them (EpisodeChoice)
  std::string model;              ///< MJCF or URDF to compare with, in the place of the task's own; may be empty
};

struct ValidationResult {
  /// design.json's, on these recordings: the nominal simulator, the designed one (the best seed's mode) and the floor.
  DesignRecord::Validation validation;
  std::optional<DesignRecord::Validation> model;  ///< `designed` is the other model's
  std::string of_model;                           ///< how it compares with both, in a sentence; empty without it
  bool predicts_better = false;                   ///< the design, than the nominal simulator, beyond chance
  bool reaches_floor = false;                     ///< what it leaves, the sensors explain
  std::string sentence;
  std::vector<std::string> warnings;  ///< why these recordings may say less, or something else, than they seem to
  std::string data_sha256;
  int n_transitions = 0;

  nlohmann::json ToJson(const ValidationRequest& request) const;
};

/// @throws UsageError where the task's logs cannot be replayed; DataError where the recordings do not fit the task or
/// are too short, or where the model is no longer the one of the design
ValidationResult Validate(const ValidationRequest& request, const RunContext& context);

}  // namespace oted
