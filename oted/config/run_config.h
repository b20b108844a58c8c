#pragma once
/// The configuration of a run: one TOML file, or the same as flags (docs/configuration.md).

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "oted/baselines/baselines_config.h"
#include "oted/config/agents_config.h"
#include "oted/config/task_config.h"
#include "oted/data/data_options.h"
#include "oted/data/episode_choice.h"
#include "oted/sim/parameter_space.h"
#include "oted/stages/agent/algorithm.h"
#include "oted/stages/clone/clone_config.h"
#include "oted/stages/design/design_choice.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

struct DataConfig {
  /// One of data.recordings: a file, and the values of the task's constants while it was recorded.
  struct Recording {
    std::string path;
    std::map<std::string, double> constants;
  };

  std::string path;
  std::vector<Recording> recordings;  ///< in place of `path`
  std::string episodes = "all";
  std::optional<DataFormat> format;
  CsvLayout columns;
  int action_delay = 0;
  Rescaling rescaling;
  std::vector<std::string> unwrap;
  FieldList Fields();
  bool empty() const { return path.empty() && recordings.empty(); }
  /// @throws UsageError where no data are named
  void CheckNamed() const;
  /// @throws UsageError
  EpisodeChoice ChosenEpisodes() const;
  std::vector<std::string> AllFiles() const;
  /// For sentences: "a.csv", "a.csv and 2 more".
  std::string Files() const;
  /// This file and no other.
  void Take(const std::string& file);
  nlohmann::json RecordingsToJson() const;
  /// @throws UsageError where a recording has a constant that is none of `names`
  void CheckConstants(const std::vector<std::string>& names) const;
  /// What the reader is told; the task's own numbers and names are the pipeline's to add (DataOptionsFor).
  DataOptions Options() const;
};

struct RunSettings {
  int64_t seed = 1;
  int threads = 0;
  bool strict = false;
  FieldList Fields();
};

/// Whether the report shows films: "auto" where they can be drawn.
enum class Motion { kAuto, kTrue, kFalse };

/// What the report shows beyond the results.
struct ReportConfig {
  Motion motion = Motion::kAuto;
  int replay_steps = 0;
  FieldList Fields();
};

struct RunConfig {
  TaskConfig task;
  DataConfig data;
  std::vector<ParameterSpec> parameters;
  std::string parameter_file = {};  ///< of mujoco.sysid, from which some of them were read; empty: none
  /// Names of presets whose parameters are added (oted/sim/presets.h); the pipeline replaces them by what they stand
  /// for.
  std::vector<std::string> presets;
  RunSettings run;
  CloneConfig clone;
  DesignChoice design;
  /// Hyperparameter settings h of Sec. 4.2: what each changes in `design`. Without any there is one, "default".
  std::map<std::string, DesignChoice> settings;
  SelectionConfig selection;
  AgentsConfig agents;
  AlgorithmSettings algorithms;  ///< [sac], [crossq] and [ppo]
  BaselinesConfig baselines;
  ReportConfig report;
  /// The true parameters, where a study knows them: read by evaluation and report only.
  std::map<std::string, double> truth;

  /// The algorithm of a task's agents. @throws as AgentsConfig::AlgorithmFor
  const AlgorithmEntry& Algorithm(const SimulatorSpec& spec) const { return EntryOf(agents.AlgorithmFor(spec)); }
  /// @throws UsageError for settings of an algorithm that agents do not learn by: they would do nothing; as the check
  /// of the one that they learn by
  void CheckAgentSettings(const SimulatorSpec& spec) const;

  /// Reads TOML. Paths in it are relative to its folder. @throws UsageError with file and line, DataError when
  /// unreadable.
  /// @param parameter_file  read in place of what `[parameters] sysid` names; "" for that
  static RunConfig FromToml(const std::string& text, const std::string& file_name,
                            const std::string& parameter_file = "");
  static RunConfig FromTomlFile(const std::string& path, const std::string& parameter_file = "");
  /// The resolved configuration, every default written out; FromToml reads it back.
  std::string ToToml() const;
  nlohmann::json ToJson() const;

  /// Takes "section.key=value" as typed for --set. @throws UsageError
  void Set(const std::string& assignment);
  /// Takes "name=value" as typed for --truth.
  void SetTruth(const std::string& assignment);
  /// @throws UsageError when something that every stage needs is missing or contradictory.
  void Check() const;
  /// The truth in the order of the parameters; empty when unknown.
  std::vector<double> TruthVector() const;
  /// Threads to use: run.threads, or all that the process may use.
  int Threads() const;
  /// The hyperparameter settings of the design; "default" where none is named.
  std::map<std::string, DesignChoice> DesignSettings() const;
  /// Says of settings of the design that they are set and that no method which may run reads them; none where all are
  /// read.
  std::optional<std::string> UnreadSetting() const;
};

/// Every section's fields, bound to `config`, but for those of the design (DesignChoice).
std::vector<FieldList> PlainSections(RunConfig& config);

}  // namespace oted
