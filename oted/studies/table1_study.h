#pragma once
/// The paper's Table 1: what policies earn in the target. The target is the task at its nominal parameters, as the
/// paper's is; the simulator's parameters are unknown within a range. A cell is one number of the table.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/config/run_config.h"

namespace oted {

enum class Table1Method {
  kBc,         ///< "bc"
  kFisherBrc,  ///< "f_brc", as the next three from the logs alone
  kMbop,       ///< "mbop"
  kTd3Bc,      ///< "td3_bc"
  kRebrac,     ///< "rebrac"
  kDr,         ///< "dr"
  kIs,         ///< "is"
  kBcDr,       ///< "bc_dr"
  kOted,       ///< "oted"
  kNominal,    ///< "nominal": an agent in the guess's simulator
};
/// In the paper's order, with two baselines that it lacks, and the agent in the guess's simulator.
const NamedValues<Table1Method>& Table1MethodNames();

/// One method on what it depends on: agents that see no logs serve all of a task's datasets, a clone all parameters.
struct Table1Cell {
  std::string task;
  std::string dataset;     ///< "" for dr, is, nominal
  std::string parameters;  ///< "friction", "gain", "gravity", "all"; "" for bc and the offline ones
  Table1Method method = Table1Method::kOted;

  /// "hopper-medium-all-oted", "hopper-all-dr", "hopper-medium-bc"
  std::string Name() const;
  bool operator==(const Table1Cell&) const = default;
};

/// What a program adds to a study, which neither prints nor writes reports.
struct Table1Hooks {
  /// Keeps the curves of a run in `folder` and passes everything else on to `inner`.
  std::function<std::unique_ptr<LogSink>(const std::filesystem::path& folder, LogSink* inner)> keep_curves;
  /// Called after a whole run (method oted) is complete in `folder`.
  std::function<void(const std::filesystem::path& folder)> run_complete;
};

struct Table1Study {
  std::vector<std::string> tasks = {"halfcheetah", "hopper", "walker2d"};
  std::vector<std::string> datasets = {"medium", "medium-expert", "expert"};
  std::vector<std::string> parameters = {"friction", "gain", "gravity", "all"};
  std::vector<std::string> methods = KnownMethods();
  std::string data_folder = "examples/data";  ///< holds TASK-DATASET.hdf5
  std::string design_method = "auto";
  std::string algorithm = "sac";  ///< of the agents: the paper's, or "crossq"
  /// Where the nominal simulator of the study is and interval search begins, for the target is the nominal simulator
  /// itself: the shipped shifted target (0.6, 1.3, 1.2) seen the other way round.
  std::map<std::string, double> guess = {{"friction", 1.67}, {"gain", 0.77}, {"gravity", 0.83}};
  std::vector<std::string> assignments;  ///< "section.key=value", for every cell
  int64_t steps = 200'000;               ///< control steps of one agent
  int n_seeds = 1;
  int64_t first_seed = 1;

  /// The names of all methods.
  static const std::vector<std::string>& KnownMethods();
  /// Every cell once; what bc_dr collects with comes with it.
  /// @throws UsageError when a task, dataset, parameter or method is none of the table's
  std::vector<Table1Cell> Cells() const;
  /// The configuration of one seed of a cell: that of `oted run`, as far as the method goes.
  RunConfig ConfigOf(const Table1Cell& cell, int64_t seed) const;
};

/// Runs what is missing of all cells, seeds and methods side by side on the context's threads. After each seed its
/// cell's line in OUT.jsonl (schema oted.table1_cell/1, docs/file_formats.md) holds all that are done; agents and
/// runs lie in OUT/runs/NAME/SEED, and go on from there after a stop.
/// @return the records, in the order of Cells()
/// @throws UsageError when the file holds seeds of other settings; DataError when demonstrations are missing;
/// Interrupted
std::vector<nlohmann::json> RunTable1(const Table1Study& study, const std::filesystem::path& out,
                                      const std::string& command, const Table1Hooks& hooks, const RunContext& context);

}  // namespace oted
