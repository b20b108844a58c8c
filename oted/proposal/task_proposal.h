#pragma once
/// A first task file, from a model and logs: what matched, what was guessed, what could not be told.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/config/run_config.h"
#include "oted/proposal/column_map.h"
#include "oted/proposal/parameter_choice.h"

namespace oted {

struct ProposalRequest {
  std::string model;                        ///< MJCF or URDF, or package:...
  std::vector<std::string> logs;            ///< at least one; several become data.recordings
  std::filesystem::path out = "task.toml";  ///< must not exist
  double control_period = 0;                ///< [s]; 0: that of the logs
  bool with_schema = false;                 ///< the schema beside `out`, named in its first line, for editors
};

struct Proposal {
  RunConfig config;  ///< with paths as seen from here
  ColumnMap columns;
  std::vector<std::string> guessed;                ///< what the user should confirm
  std::vector<std::string> suspicious;             ///< what does not fit, and what to do
  std::vector<ParameterChoice::LeftOut> left_out;  ///< parameters that were not freed
  std::string text;                                ///< of the task file

  /// Whether a path of a parameter has the word, which the file and the terminal then explain.
  bool NamesActuated() const;
  static constexpr const char* kActuated = "what an actuator drives, and nothing else";

  /// "name (field): why" of each parameter that was left out.
  std::vector<std::string> NotFreed() const;

  /// Schema oted.init/1. @param out  where the task file stands
  nlohmann::json ToJson(const std::filesystem::path& out) const;
};

/// Writes request.out. A schema that lies there is written anew. What it writes has been tried: the model, the logs and
/// the parameters go together.
/// @throws UsageError where `out` is there already or something has to be said (the control period); DataError where
/// no column is an observation, or none an action
Proposal ProposeTask(const ProposalRequest& request, const RunContext& context);

}  // namespace oted
