#include "oted/run/pipeline.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "oted/checks/data_check.h"
#include "oted/run/artifacts.h"
#include "oted/run/evaluation_step.h"
#include "oted/run/growth_step.h"
#include "oted/run/policy_selection_step.h"
#include "oted/run/provenance.h"
#include "oted/run/replay_step.h"
#include "oted/stages/design/design_method.h"

namespace oted {
namespace {

Concern ConcernOf(DesignMethod method) {
  if (method == DesignMethod::kTrajectories) return Concern::kEveryMethod;
  return Describe(method).learns_discriminator() ? Concern::kDiscriminatingMethods : Concern::kOtherMethods;
}

}  // namespace

Pipeline::Pipeline(RunConfig config, const std::filesystem::path& out, RunContext context)
    : run_(SetUpRun(std::move(config), out, context)) {
  for (const std::string& warning : run_.dataset.warnings) {
    run_.context.log->Warning(fmt::format("'{}': {}", run_.config.data.Files(), warning));
  }
  WriteProvenance(run_);
}

void Pipeline::WarnAboutData() {
  if (std::exchange(told_of_data_, true)) return;
  Concern most = Concern::kEveryMethod;
  for (const auto& [name, setting] : run_.settings) most = std::max(most, ConcernOf(setting.config.method));
  for (const std::string& warning : DataWarnings(run_.dataset, run_.spec(), most)) {
    run_.context.log->Warning(warning + "; 'oted data check' has more");
  }
}

const ClonedBehavior& Pipeline::CloneBehavior() {
  if (clone_) return *clone_;
  if (!run_.directory.IsComplete(CloneArtifact(run_))) WarnAboutData();
  clone_ = MakeClone(run_);
  return *clone_;
}

const std::vector<Design>& Pipeline::Design() {
  if (designs_) return *designs_;
  if (!run_.directory.IsComplete(SelectionArtifact(run_))) WarnAboutData();
  Grow(run_);
  designs_ = MakeDesigns(run_, run_.settings, [this] { return CloneBehavior().policy.get(); });
  return *designs_;
}

const SelectedDesign& Pipeline::SelectSimulator() {
  if (!selected_) selected_ = SelectDesign(run_, Design(), [this] { return CloneBehavior().policy.get(); });
  return *selected_;
}

void Pipeline::ReplayLogs() { ::oted::ReplayLogs(run_, SelectSimulator().record); }

const Agents& Pipeline::TrainAgents() {
  if (agents_) return *agents_;
  CheckHasReward(run_.spec());  // before an hour of design
  ReplayLogs();
  agents_ = ::oted::TrainAgents(run_, SelectSimulator(), *CloneBehavior().policy);
  return *agents_;
}

const PolicySelectionRecord& Pipeline::SelectPolicy() {
  if (policy_) return *policy_;
  const Agents& agents = TrainAgents();
  policy_ = SelectAgent(run_, SelectSimulator(), agents);
  return *policy_;
}

const std::optional<EvaluationRecord>& Pipeline::EvaluateInTarget() {
  if (evaluation_ || run_.config.truth.empty()) return evaluation_;
  const PolicySelectionRecord& policy = SelectPolicy();
  evaluation_ = Evaluate(run_, SelectSimulator(), TrainAgents(), *CloneBehavior().policy, policy);
  return evaluation_;
}

void Pipeline::Run() {
  ReplayLogs();
  if (!run_.spec().has_reward) {
    run_.context.log->Warning(fmt::format(
        "task '{}' has no reward: the simulator is designed and no agent is trained; add task.reward to train one",
        run_.config.task.name));
    return;
  }
  SelectPolicy();
  EvaluateInTarget();
}

}  // namespace oted
