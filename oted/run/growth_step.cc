#include "oted/run/growth_step.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>

#include "oted/checks/data_check.h"
#include "oted/matching/verdict.h"
#include "oted/run/artifacts.h"
#include "oted/run/design_step.h"
#include "oted/run/growth_design.h"
#include "oted/run/kept_trials.h"
#include "oted/run/run_inputs.h"
#include "oted/run/suspect_sentence.h"
#include "oted/run/trial_log.h"
#include "oted/stages/design/design.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/freed.h"

namespace oted {
namespace {

/// Where predictions leave something to explain, or the fit's windows surely ask for something, what explains it;
/// elsewhere what these windows ask noticeably.
/// @param design  what the method was given; q and fit are what it gave
std::vector<Suspect> Try(const DesignProblem& design, const DesignConfig& config, const FitEvidence& fit,
                         const Designer& q, const std::optional<HeldOutPrediction>& prediction, TrialKeeper& keeper) {
  if (!prediction) return {};
  const ParameterSpace& space = design.factory.parameters();
  const Prior prior = ForTrajectories(config.Start(space).prior(), space);
  const FreedProblem problem{.factory = design.factory,
                             .dataset = design.dataset,
                             .prior = prior,
                             .fit = fit,
                             .z = q.Mode(),
                             .kept_aside = design.KeptAsideKey(),
                             .context = design.context,
                             .keeper = keeper};
  const auto free = LeavesGap(*prediction) || fit.asks_surely ? TrySuspects : TryAsked;
  return free(problem, config.trajectories.tried);
}

GrowthRecord MakeRound(const RunSetup& run, int round) {
  TrialLog log(run.context.log, fmt::format("growth {}/{}", round, kMostRounds), TrialLog::Stages::kEach);
  RunContext context = run.context;
  context.log = &log;
  const DesignProblem problem = ProblemOfRound(run, round, context);
  const QRecord design = DesignOfRound(run, round, context);
  // What a bound holds may be its range's fault: its owner is to say which, before anything is added.
  GrowthRecord record;
  for (const int i : ParametersAtBounds(design.q)) record.at_bounds.push_back(problem.factory.parameters()[i].name);
  if (!design.fit) return record;
  const auto prediction = PredictionOfRound(run, round, design, context).prediction;
  if (prediction && LeavesGap(*prediction)) {
    for (const Finding& correction : FindCorrections(*run.factory, run.dataset, context)) {
      const bool is_wrong = correction.severity == Severity::kWarning && !correction.may_be_parameter;
      if (is_wrong) record.wrong_columns.push_back(correction.what);
    }
  }
  if (!record.wrong_columns.empty() || !record.at_bounds.empty()) return record;
  const Artifact artifact = GrowthDesignArtifact(run, round);
  KeptTrials keeper(run.directory, artifact);
  record.suspects = Try(problem, run.settings.begin()->second.config, *design.fit, design.q, prediction, keeper);
  return record;
}

/// Makes `run` one of a parameter more.
void AddParameter(RunSetup& run, const Suspect& freed) {
  RunConfig& config = run.config;
  config.parameters.push_back(freed.spec);
  // The target of a study and the simulator to compare with know nothing of it.
  if (!config.truth.empty()) config.truth[freed.spec.name] = freed.spec.nominal;
  if (!config.agents.nominal_at.empty()) config.agents.nominal_at.push_back(freed.spec.nominal);
  run.factory = MakeSimulatorFactory(config.task, config.parameters, run.dataset.EpisodeStarts());
  run.has_effect.clear();
}

/// Why a round added nothing; empty where the sensors explain what is left, and nothing was to be added.
std::string WhyNothing(const GrowthRecord& round) {
  if (!round.wrong_columns.empty()) {
    return fmt::format("nothing was added: columns of the logs seem wrong ({}); mend them first",
                       fmt::join(round.wrong_columns, "; "));
  }
  if (!round.at_bounds.empty()) {
    return fmt::format("nothing was added: '{}' ends at a bound of its range; widen it first",
                       fmt::join(round.at_bounds, "', '"));
  }
  return round.suspects.empty() ? "" : "nothing was added: no suspect surely predicts better";
}

/// Rounds until one frees nothing (IsGrown). @param next  gives a round's record; none: not
/// made yet
template <class Next>
void AddRounds(RunSetup& run, const Next& next) {
  while (!IsGrown(run)) {
    std::optional<GrowthRecord> record = next(static_cast<int>(run.growth.size()) + 1);
    if (!record) return;
    if (const Suspect* freed = record->Freed()) AddParameter(run, *freed);
    run.growth.push_back(*std::move(record));
  }
}

}  // namespace

bool IsGrown(const RunSetup& run) {
  if (!run.grows() || run.growth.size() >= static_cast<size_t>(kMostRounds)) return true;
  return !run.growth.empty() && run.growth.back().Freed() == nullptr;
}

std::vector<Suspect> SuspectsOf(const RunSetup& run, const DesignFindings& findings) {
  const Candidate& best = findings.candidates[static_cast<size_t>(findings.result.best_candidate)];
  const Candidate& told = findings.candidates[ToldBy(findings)];
  if (!told.fit) return {};
  if (&told == &best && RoundOf(run, told.setting, told.seed)) {
    const GrowthRecord& round = run.growth.back();
    if (round.wrong_columns.empty() && round.at_bounds.empty()) return round.suspects;
  }
  const DesignProblem problem = ProblemOf(run, told.setting, told.seed, nullptr, run.context);
  const Artifact design = DesignArtifact(run, told.setting, told.seed);
  KeptTrials keeper(run.directory, design);
  return Try(problem, run.Designs(told.setting).config, *told.fit, told.q, best.prediction, keeper);
}

void Grow(RunSetup& run) {
  // A program that died behind a round's record may have left them.
  for (int round = 1; round <= std::ssize(run.growth); ++round) {
    KeptTrials::Remove(run.directory.growth_design(round));
  }
  AddRounds(run, [&](int round) -> std::optional<GrowthRecord> {
    auto record =
        OnceAs<GrowthRecord>(run.directory, GrowthArtifact(run, round), [&] { return MakeRound(run, round); });
    KeptTrials::Remove(run.directory.growth_design(round));
    return record;
  });
  if (run.growth.size() == 1 && run.growth.front().Freed() == nullptr) {
    if (const std::string why = WhyNothing(run.growth.front()); !why.empty()) run.context.log->Warning(why);
  }
  for (const auto& [added, rival] : DisputedIn(run.growth)) run.context.log->Warning(RivalSentence(*added, *rival));
}

void TakeFinishedGrowth(RunSetup& run) {
  AddRounds(run, [&](int round) -> std::optional<GrowthRecord> {
    const Artifact artifact = GrowthArtifact(run, round);
    if (!run.directory.IsReady(artifact)) return std::nullopt;
    return OnceAs<GrowthRecord>(run.directory, artifact, [] { return GrowthRecord{}; });
  });
}

}  // namespace oted
