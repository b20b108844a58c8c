#pragma once
/// The paper's studies of the design, cell by cell: Table 2 (simulator selection) and Figure 2 (errors by parameter).
/// The targets are the tasks at their nominal parameters, as the paper's are, unless others are named.

#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/config/run_config.h"

namespace oted {

/// What is designed from which demonstrations.
struct StudyCell {
  std::string task;        ///< "hopper"
  std::string dataset;     ///< "medium"
  std::string parameters;  ///< "friction", "gain", "gravity", or "all"

  std::string Name() const { return task + "-" + dataset + "-" + parameters; }
};

/// "name=value", as typed. @param option  for the message
/// @throws UsageError where `values` has no such name or the value is no number
void SetNamedValue(std::map<std::string, double>& values, const std::string& option, const std::string& assignment);

struct DesignStudy {
  std::vector<std::string> tasks = {"halfcheetah", "hopper", "walker2d"};
  std::vector<std::string> datasets = {"medium", "medium-expert", "expert"};
  std::vector<std::string> parameters = {"all"};
  std::string data_folder = "examples/data";  ///< holds TASK-DATASET.hdf5
  /// Where the demonstrations were made, in multiples of nominal.
  std::map<std::string, double> target = {{"friction", 1.0}, {"gain", 1.0}, {"gravity", 1.0}};
  std::string design_method = "paper";
  std::vector<std::string> assignments;  ///< "section.key=value", for every cell; the pool is made from the result
  bool grid = true;                      ///< a pool of eight settings to select from; otherwise the method's own
  int n_seeds = 3;                       ///< designs per setting
  int64_t seed = 1;
  int threads = 0;

  /// Table 2: the joint cells and the pool of settings. Figure 2: each parameter alone as well, one setting, five
  /// seeds.
  /// @throws UsageError for another name
  static DesignStudy Named(const std::string& name);
  /// @throws UsageError when a task, dataset or parameter is not one of the paper's
  std::vector<StudyCell> Cells() const;
  RunConfig ConfigOf(const StudyCell& cell) const;
  /// What a cell's record depends on, beside the demonstrations, as it stands in the record.
  nlohmann::json IdentityOf(const StudyCell& cell) const;
  /// @throws UsageError where the record of a cell is of another study than this one
  void CheckIsOfThis(const StudyCell& cell, const nlohmann::json& record) const;
};

/// What a finished cell says (schema oted.cell/1), from its design.json: each setting's design error (mean absolute
/// error over parameters, in multiples of nominal; mean and standard deviation over seeds) and scores; for each way of
/// selecting, the setting that it picks, that setting's error, and its regret: what it is worse than the pool's best.
/// "random" is the mean over the pool. `counts`: the pool's worst error is at least three times its best, so that there
/// is something to select. `middle_error` is that of the middle of the range, where Algorithm 1's q begins.
nlohmann::json ScoreCell(const DesignStudy& study, const StudyCell& cell, const nlohmann::json& design);

/// Table 2 as Markdown, our errors beside the paper's.
std::string Table2(const std::vector<nlohmann::json>& cells);
/// Figure 2's errors as Markdown, by parameter, alone and jointly.
std::string Figure2(const std::vector<nlohmann::json>& cells);

}  // namespace oted
