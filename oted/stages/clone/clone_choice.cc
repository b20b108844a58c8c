#include "oted/stages/clone/clone_choice.h"

#include <fmt/format.h>

#include <numeric>
#include <utility>

#include "oted/matching/held_out.h"
#include "oted/matching/judge.h"
#include "oted/stages/clone/behavioral_cloning.h"
#include "oted/stages/clone/value_dice.h"

namespace oted {
namespace {

constexpr int kLanes = 8, kSteps = 300;

MethodEvidence EvidenceOf(const CloneResult& clone, const Dataset& logs, const Dataset& held_out,
                          const SimulatorFactory* nominal, int judge_steps, RngKey key) {
  const auto& policy = dynamic_cast<const TanhGaussianPolicy&>(*clone.policy);
  std::vector<int> rows(static_cast<size_t>(held_out.size()));
  std::iota(rows.begin(), rows.end(), 0);
  MethodEvidence evidence;
  evidence.held_out_loss = LogLoss(policy, held_out, rows);
  if (nominal == nullptr) return evidence;
  EvidenceConfig rollouts;
  rollouts.dataset_starts = rollouts.replayed_actions = rollouts.transitions = false;
  rollouts.horizon = rollouts.n_steps = kSteps;
  rollouts.first_rows = true;
  rollouts.n_past_actions = nominal->spec().n_past_actions;
  const std::vector<std::vector<double>> z(kLanes, nominal->parameters().Nominal());
  const JudgeHalves halves = SplitForJudge(logs);
  evidence.closeness = JudgeSimulator(*nominal, {halves, clone.policy.get(), rollouts, judge_steps}, z, key).common;
  return evidence;
}

/// Passes progress on and keeps curves to itself.
class ProgressOnly : public NullSink {
 public:
  explicit ProgressOnly(LogSink* log) : log_(log) {}
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                std::string_view note) override {
    log_->Progress(stage, label, done, total, note);
  }

 private:
  LogSink* log_;
};

}  // namespace

CloneResult ChooseClone(const CloneJob& job, int judge_steps) {
  const HeldOutParts parts = HoldOut(job.dataset, job.key.Stage("choice"));
  // Their curves would stand among those of the clone that is kept.
  ProgressOnly quiet(job.context.log);
  RunContext own = job.context;
  own.log = &quiet;
  const CloneJob trial{parts.learn, job.spec, job.config, job.key.Stage("trial"), job.run_name, own};
  const CloneResult bc = CloneByLikelihood(trial), valuedice = CloneByValueDice(trial);

  CloneChoice choice;
  choice.n_held_out = parts.judge.size();
  const RngKey judge = job.key.Stage("judge");
  choice.bc = EvidenceOf(bc, job.dataset, parts.judge, job.nominal, judge_steps, judge);
  choice.valuedice = EvidenceOf(valuedice, job.dataset, parts.judge, job.nominal, judge_steps, judge);
  bool takes_valuedice = false;
  if (job.nominal != nullptr) {
    const double gain = *choice.valuedice.closeness - *choice.bc.closeness;
    takes_valuedice = gain > kMargin;
    choice.reason = fmt::format(
        "acting in the nominal simulator, the clone by ValueDICE is {} to tell from the logs than the behavioural one "
        "({:+.4f} nats of a judge's held-out loss; {} counts)",
        gain > 0 ? "harder" : "no harder", gain, fmt::format("more than {:g}", kMargin));
  } else {
    const double gain = choice.bc.held_out_loss - choice.valuedice.held_out_loss;
    takes_valuedice = gain > 0;
    choice.reason = fmt::format(
        "the clone by ValueDICE finds the actions of held-out episodes {} than the behavioural one ({:+.4f} nats per "
        "transition)",
        gain > 0 ? "likelier" : "no likelier", gain);
  }
  CloneResult result = takes_valuedice ? CloneByValueDice(job) : CloneByLikelihood(job);
  result.choice = std::move(choice);
  return result;
}

}  // namespace oted
