#pragma once
/// The whole method of "Targeted Environment Design from Offline Data", as calls in the paper's order.
///
///   Pipeline pipeline(config, "runs/hopper", context);
///   pipeline.CloneBehavior();      // stage 1, Sec. 4 step 1:  mu-hat from D
///   pipeline.Design();             // stage 2, Sec. 4.1:       q(z | h_i) for every setting h and seed i
///   pipeline.SelectSimulator();    // stage 3, Sec. 4.2:       the best h
///   pipeline.ReplayLogs();         //                          for the report: logs beside their replay at q's mode
///   pipeline.TrainAgents();        // stage 4, Algorithm 2:    pi_j in the modes z_i of q(. | h_i)
///   pipeline.SelectPolicy();       // stage 5, Sec. 4.2:       the best pi_j
///   pipeline.EvaluateInTarget();   // only where a study knows the truth
///
/// Each call runs those before it that it needs and that are missing, reads what is complete in the run directory, and
/// goes on from where it was stopped. What a call gave is handed on in memory. Of these the last alone reads the truth.

#include <filesystem>
#include <optional>
#include <vector>

#include "oted/base/log.h"
#include "oted/config/run_config.h"
#include "oted/run/agents_step.h"
#include "oted/run/clone_step.h"
#include "oted/run/design_step.h"
#include "oted/run/policy_records.h"
#include "oted/run/run_setup.h"
#include "oted/run/selection_step.h"

namespace oted {

class Pipeline {
 public:
  /// Reads and checks data, model and parameters; nothing is written before all of that is right.
  /// @throws UsageError, DataError
  Pipeline(RunConfig config, const std::filesystem::path& out, RunContext context);

  /// The other calls make the clone when something needs it: a design that replays logged actions does not.
  const ClonedBehavior& CloneBehavior();
  const std::vector<oted::Design>& Design();
  const SelectedDesign& SelectSimulator();
  void ReplayLogs();
  const Agents& TrainAgents();
  const PolicySelectionRecord& SelectPolicy();
  /// @return none where the truth is not known
  const std::optional<EvaluationRecord>& EvaluateInTarget();
  /// All of the above; up to ReplayLogs for a task without a reward, with a warning.
  void Run();

  const RunConfig& config() const { return run_.config; }
  const RunDirectory& directory() const { return run_.directory; }
  const Dataset& dataset() const { return run_.dataset; }

 private:
  /// The checks of data that need no simulator: told before long work starts, and no more than told.
  void WarnAboutData();

  RunSetup run_;
  bool told_of_data_ = false;
  std::optional<ClonedBehavior> clone_;
  std::optional<std::vector<oted::Design>> designs_;
  std::optional<SelectedDesign> selected_;
  std::optional<Agents> agents_;
  std::optional<PolicySelectionRecord> policy_;
  std::optional<EvaluationRecord> evaluation_;
};

}  // namespace oted
