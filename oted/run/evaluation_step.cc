#include "oted/run/evaluation_step.h"

#include <cmath>
#include <string>
#include <utility>

#include "oted/base/statistics.h"
#include "oted/rl/batch_policy.h"
#include "oted/run/artifacts.h"
#include "oted/sim/rollout.h"
#include "oted/sim/task_policy.h"

namespace oted {
namespace {

/// Runs policies in the target, one after the other.
class TargetJudge {
 public:
  /// @param n_policies  that will be judged, for the progress
  TargetJudge(const RunSetup& run, int n_policies)
      : run_(run), n_policies_(n_policies), key_(run.Key("target")), n_(run.config.agents.target_episodes) {}

  void Judge(const std::string& name, const std::string& label, const Policy& policy) {
    Judge(name, label, AsBatchPolicy(policy, run_.JudgedNoise(), key_.Stage(name).MakeRng()));
  }
  void JudgeRandom() {
    Rng random = key_.Stage("random").MakeRng();
    Judge("random", "random actions", UniformRandomPolicy(run_.spec(), random));
  }
  /// What can be reached at most, by one who sees the whole state; and with it a score.
  void JudgeExpert() {
    const auto simulator = run_.factory->Make(n_, run_.context.n_threads);
    const BatchPolicy expert = OnTrueStates(*simulator, TaskPolicy::kExpert, key_.Stage("expert").MakeRng());
    Record("expert", "shortest paths, all in sight", Run(*simulator, expert));
    const double low = results_.front().mean_return, high = results_.back().mean_return;
    for (EvaluationRecord::PolicyResult& result : results_) {
      if (high > low) result.score = 100 * (result.mean_return - low) / (high - low);
    }
  }

  std::vector<EvaluationRecord::PolicyResult> results() && { return std::move(results_); }

 private:
  std::vector<EpisodeResult> Run(Simulator& simulator, const BatchPolicy& policy) const {
    return RunEpisodes(simulator, std::vector(static_cast<size_t>(n_), run_.config.TruthVector()), policy, key_);
  }
  void Judge(const std::string& name, const std::string& label, const BatchPolicy& policy) {
    Record(name, label, Run(*run_.factory->Make(n_, run_.context.n_threads), policy));
  }
  void Record(const std::string& name, const std::string& label, const std::vector<EpisodeResult>& episodes) {
    const std::vector<double> returns = ComparableReturns(episodes);
    EvaluationRecord::PolicyResult result{
        name, label, Mean(returns), StandardDeviation(returns), CountDiverged(episodes), {}};
    if (run_.spec().has_score()) result.score = run_.spec().NormalizedScore(result.mean_return);
    results_.push_back(std::move(result));
    run_.context.log->Progress("evaluate", "target", static_cast<int64_t>(results_.size()), n_policies_, label);
  }

  const RunSetup& run_;
  int n_policies_;
  RngKey key_;
  int n_;
  std::vector<EvaluationRecord::PolicyResult> results_;
};

std::string LabelOf(Ground ground, const std::string& algorithm) {
  switch (ground) {
    case Ground::kDomainRandomization:
      return algorithm + ", domain randomisation (DR)";
    case Ground::kIntervalSearch:
      return algorithm + ", interval search (IS)";
    case Ground::kNominal:
      return algorithm + " in the nominal simulator";
    case Ground::kDesigned:
      break;
  }
  return "OTED-" + algorithm;
}

std::vector<EvaluationRecord::PolicyResult> JudgeAll(const RunSetup& run, const Agents& agents, const Policy& clone,
                                                     const TrainedRecord& selected) {
  const bool has_bc_dr = agents.bc_dr.policy != nullptr, has_expert = run.factory->has_expert();
  const std::vector<Ground> grounds = run.Grounds();
  TargetJudge judge(run, 2 + static_cast<int>(grounds.size()) + (has_bc_dr ? 1 : 0) + (has_expert ? 1 : 0) +
                             static_cast<int>(agents.offline.size()));
  const AlgorithmEntry& algorithm = run.config.Algorithm(run.spec());
  judge.JudgeRandom();
  judge.Judge("clone", "clone of the logs", clone);
  for (const auto& [baseline, stored] : agents.offline) {
    const OfflineEntry& entry = EntryOf(baseline);
    judge.Judge(entry.name, entry.title + " learned from the logs", *stored.policy);
  }
  if (has_bc_dr) judge.Judge("bc_dr", "clone of logs and data under DR (BC+DR)", *agents.bc_dr.policy);
  // Of what is compared with, too, the one of its m agents that does best where it was trained. Baselines come first.
  const auto judge_best = [&](Ground ground) {
    judge.Judge(algorithm.name + "_" + NameOf(GroundNames(), ground), LabelOf(ground, algorithm.title),
                *agents.Best(ground).policy);
  };
  for (const Ground ground : grounds) {
    if (ground != Ground::kDesigned && ground != Ground::kNominal) judge_best(ground);
  }
  if (agents.of.contains(Ground::kNominal)) judge_best(Ground::kNominal);
  judge.Judge("oted_" + algorithm.name, LabelOf(Ground::kDesigned, algorithm.title), *selected.policy);
  if (has_expert) judge.JudgeExpert();
  return std::move(judge).results();
}

}  // namespace

EvaluationRecord Evaluate(const RunSetup& run, const SelectedDesign& design, const Agents& agents, const Policy& clone,
                          const PolicySelectionRecord& selection) {
  return OnceAs<EvaluationRecord>(run.directory, EvaluationArtifact(run), [&] {
    const auto selected = static_cast<size_t>(selection.selected - 1);
    EvaluationRecord record;
    record.task = run.config.task.name;
    record.episodes = run.config.agents.target_episodes;
    record.policies = JudgeAll(run, agents, clone, agents.of.at(Ground::kDesigned)[selected]);
    const std::vector<double> truth = run.config.TruthVector();
    for (size_t i = 0; i < truth.size(); ++i) {
      const DesignRecord::Parameter& p = design.record.parameters.at(i);
      record.parameters.push_back({p.name, p.unit, p.nominal, truth[i], p.mode, p.std, std::abs(p.mode - truth[i])});
    }
    return record;
  });
}

}  // namespace oted
