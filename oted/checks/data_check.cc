#include "oted/checks/data_check.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <numbers>
#include <set>

#include "oted/base/error.h"
#include "oted/checks/corrections.h"
#include "oted/checks/engine_check.h"
#include "oted/checks/late_recordings.h"
#include "oted/data/checks_dynamics.h"
#include "oted/data/checks_rows.h"
#include "oted/stages/clone/clone.h"
#include "oted/stages/design/effects.h"

namespace oted {
namespace {

constexpr double kWorseThanBlind = 0.47;  // area under the curve
constexpr const char* kShiftedActions = "shifted_actions";
constexpr int kOneStepRows = 2000;
constexpr double kExact = 1e-3;     // median ratio below which the simulator is the logs' own
constexpr double kUseless = 0.5;    // above which it predicts a step hardly better than "nothing changes"
constexpr double kFarBetter = 0.5;  // of its error: what a linear fit of the logs leaves where it predicts far better
constexpr double kAsNear = 1.1;     // of what a linear fit leaves
constexpr int kGapSteps = 3000;     // control steps of each half
constexpr int kJudgeSteps = 400;    // as selection.judge_steps
constexpr double kSmallAuc = 0.55, kClearAuc = 0.75;
constexpr int kEffectEpisodes = 3;

/// The most that the sensors' noise can be, per channel in its unit: it makes up what a linear fit leaves of a change.
std::vector<double> NoiseAtMost(const std::vector<ChannelNoise>& noise, int obs_dim) {
  std::vector<double> most(static_cast<size_t>(obs_dim), 0.0);
  for (size_t j = 0; j < noise.size(); ++j) most[j] = noise[j].rms_residual / std::numbers::sqrt2;
  return most;
}

/// The share of the channels that move whose `is_so(j)` is true; none where no linear fit was made.
template <class Predicate>
std::optional<double> ShareOfMoving(const std::vector<ChannelNoise>& noise, const Predicate& is_so) {
  double n = 0, n_so = 0;
  for (size_t j = 0; j < noise.size(); ++j) {
    if (noise[j].rms_change <= 0) continue;
    ++n;
    if (is_so(j)) ++n_so;
  }
  return n > 0 ? std::optional(n_so / n) : std::nullopt;
}

/// Whether a linear fit predicts a step far better than the nominal simulator, in most channels: what that one misses
/// is then no noise. True where no fit was made.
bool IsLineFarBetter(const OneStepError& e, const std::vector<ChannelNoise>& noise) {
  const auto is_better = [&](size_t j) { return noise[j].rms_residual < kFarBetter * e.rms_error[j]; };
  return ShareOfMoving(noise, is_better).value_or(1) >= 0.5;
}

/// Whether the nominal simulator misses a step by no more than a linear fit of the logs, in most channels.
bool IsAsNearAsLine(const OneStepError& e, const std::vector<ChannelNoise>& noise) {
  const auto is_near = [&](size_t j) { return e.rms_error[j] < kAsNear * noise[j].rms_residual; };
  return ShareOfMoving(noise, is_near).value_or(0) > 0.5;
}

void CheckTerminals(const SimulatorFactory& factory, const Dataset& dataset, const std::vector<ChannelNoise>& noise,
                    RngKey key, std::vector<Finding>& findings) {
  const TerminalAgreement agreement =
      CompareTerminals(factory, dataset, NoiseAtMost(noise, dataset.obs_dim()), kOneStepRows, key);
  const std::string& task = factory.spec().task;
  if (agreement.n_unexplained > 0) {
    findings.push_back(
        {.check = "unexplained_terminals",
         .severity = Severity::kWarning,
         .what =
             fmt::format("{} by the rule of {}: s' lies within its healthy range",
                         agreement.n_unexplained == 1 ? "one terminal is none"
                                                      : fmt::format("{} terminals are none", agreement.n_unexplained),
                         task),
         .row = agreement.first_unexplained,
         .count = agreement.n_unexplained,
         .meaning = "a time limit or a stop by hand is marked as terminal (agents would learn that the state is worth "
                    "nothing), or the observations have another frame or unit than the task's",
         .remedy = "mark what the robot did not end itself as a timeout; compare the ranges in oted data info"});
  }
  if (agreement.n_missed > 0) {
    findings.push_back(
        {.check = "missed_terminals",
         .severity = Severity::kWarning,
         .what = agreement.n_missed == 1
                     ? fmt::format("one row leads out of the healthy range of {} and is not terminal", task)
                     : fmt::format("{} rows lead out of the healthy range of {} and are not terminal",
                                   agreement.n_missed, task),
         .row = agreement.first_missed,
         .count = agreement.n_missed,
         .meaning = "the task would have ended there: the log goes on beyond, or has another frame or "
                    "unit",
         .remedy = "set terminals to 1 there and end the episode, or use a task with the log's rule"});
  }
}

/// The parameter that takes a delay; empty where there is none.
std::string DelayAmong(const ParameterSpace& parameters) {
  const auto is_delay = [](const ParameterSpec& spec) { return spec.field.ends_with("/delay"); };
  const auto found = std::ranges::find_if(parameters.specs(), is_delay);
  return found == parameters.specs().end() ? "" : found->name;
}

/// Actions that stand a row before or after the one that they acted in.
std::optional<Finding> FindShift(const OneStepError& e, const SimulatorFactory& factory) {
  const std::optional<ActionShift> better = BetterShift(e, kShiftGain);
  if (!better || e.median_ratio < kExact) return std::nullopt;
  const bool is_before = better->shift < 0;
  const std::string delay = is_before ? DelayAmong(factory.parameters()) : "";
  return Finding{
      .check = kShiftedActions,
      .severity = delay.empty() ? Severity::kWarning : Severity::kNote,
      .what = ShiftInWords(*better),
      .count = std::abs(better->shift),
      .meaning = is_before ? "the target acts with a delay, its sensors show late, or actions were logged too early"
                           : "actions were logged too late: with the state that they led to",
      .remedy = !delay.empty() ? fmt::format("none needed: the parameter '{}' takes it", delay)
                : is_before    ? "shift the actions in the log by this number of rows, or make the delay a parameter: "
                                 "action/delay, obs/NAME/delay"
                               : "give each row the action of that later row",
      .may_be_parameter = is_before};
}

void AddOneStep(const OneStepError& e, const SimulatorFactory& factory, const std::vector<ChannelNoise>& noise,
                std::vector<Finding>& findings) {
  const SimulatorSpec& spec = factory.spec();
  if (e.n_rows == 0) {
    findings.push_back({.check = "one_step_error",
                        .severity = Severity::kWarning,
                        .what = fmt::format("no row could be repeated: {} states cannot be set, {} diverged",
                                            e.n_unsettable, e.n_diverged),
                        .count = e.n_unsettable + e.n_diverged,
                        .meaning = "the states in the log are no states of this model",
                        .remedy = "check units, frames and the order of the columns"});
    return;
  }
  const bool moves = std::ranges::any_of(e.rms_change, [](double change) { return change > 0; });
  const bool exact = moves && e.median_ratio < kExact;
  // Not where factors of what the simulator does would mend it: wrong gains, masses and dampings are that.
  const auto own = e.ratio_by_shift.find(0);
  const bool poor = e.median_ratio > kUseless && (own == e.ratio_by_shift.end() || own->second > kUseless);
  const bool useless = poor && IsLineFarBetter(e, noise);
  findings.push_back(
      {.check = "one_step_error",
       .severity = useless ? Severity::kWarning : Severity::kNote,
       .what = moves ? fmt::format("set to s and given a, the nominal {} misses s' by {:.2g} of its change (median "
                                   "over channels, {} rows)",
                                   spec.task, e.median_ratio, e.n_rows)
                     : fmt::format("s' is s in all of {} rows: there is no change to compare the nominal {} with",
                                   e.n_rows, spec.task),
       .count = e.n_rows,
       .meaning =
           !moves  ? "the robot rests: a design learns from motion alone"
           : exact ? "model, engine and control rate are the logs' own: there is nothing to design"
           : useless
               ? "predicting no change would hardly be worse, and a linear fit of the logs misses half as much at "
                 "most: units, order of columns, control rate or delay do that, or parameters that are far off"
           : poor ? "a linear fit of the logs does little better: noise, or motion that is fast for these rows, hides "
                    "what one row tells"
           : noise.empty() ? "so few rows do not tell noise from what differs: a design may"
           : IsAsNearAsLine(e, noise)
               ? "a linear fit of the logs does no better: noise may be all of it, and a design tells"
               : "model or parameters differ from the target: that is what a design is for",
       .remedy = !moves          ? "log motion"
                 : useless       ? "look at the channels one by one before you design"
                 : exact || poor ? "none needed"
                                 : "none needed; channels that miss much more than others point at what differs"});
  if (e.n_diverged > 0) {
    findings.push_back(
        {.check = "diverged_steps",
         .severity = Severity::kWarning,
         .what = fmt::format("the physics broke down on {} of {} rows", e.n_diverged, e.n_rows + e.n_diverged),
         .count = e.n_diverged,
         .meaning = "these states or actions are impossible in the model",
         .remedy = "check units and frames; a step size that is too large does it, too"});
  }
  if (std::optional<Finding> shift = FindShift(e, factory)) findings.push_back(*std::move(shift));
}

void AddGap(const SimulatorSpec& spec, int n_transitions, DataCheck& check) {
  const JudgeScore& s = *check.gap;
  check.is_little = n_transitions < kFewTransitions;
  const GapVerdict verdict = check.Verdict();
  const bool is_unsure = s.auc < kWorseThanBlind;
  const std::string meaning =
      verdict == GapVerdict::kNone && is_unsure ? "a classifier that guesses worse than a blind one has learned what "
                                                  "does not last: it cannot tell; make a design"
      : check.is_little                         ? "so few transitions cannot tell: a classifier learns "
                                                  "little from them; look at the one-step errors, and make "
                                                  "a design"
      : verdict == GapVerdict::kNone ? "no gap was seen in single rows; a design shows one that so few transitions "
                                       "hide, or that adds up over many rows"
      : verdict == GapVerdict::kUnknown
          ? "a clone of the logged policy acted, and its own errors tell, too: whether there "
            "is a gap a design shows"
      : verdict == GapVerdict::kSmall ? "a small gap in single rows; a design shows how it adds up over many"
                                      : "a clear gap: a design is worth its time";
  check.findings.push_back(
      {.check = "gap",
       .severity = Severity::kNote,
       .what = fmt::format("a classifier tells logs from the nominal {} with an area under the curve of {:.3f} "
                           "(0.5: blind, 1: always), accuracy {:.2f}, common score {:.3f} (log 2 = {:.3f}: blind); "
                           "held out, on {} logged transitions",
                           spec.task, s.auc, s.accuracy, s.common, std::numbers::ln2, n_transitions),
       .count = n_transitions,
       .meaning = meaning,
       .remedy = verdict == GapVerdict::kNone ? "none needed; more episodes make the statement stronger"
                 : check.is_little            ? "log more"
                                              : "oted design"});
}

void CheckEffects(const SimulatorFactory& factory, const Dataset& dataset, RngKey key, int n_threads,
                  std::vector<Finding>& findings) {
  const auto effects = MeasureEffects(factory, dataset, kEffectEpisodes, key, n_threads);
  std::vector<std::string> seen;
  for (size_t i = 0; i < effects.size(); ++i) {
    const ParameterSpec& spec = factory.parameters()[static_cast<int>(i)];
    if (effects[i].largest_change > 0) {
      const double change = effects[i].largest_change;
      seen.push_back(
          change < kBreaksDown
              ? fmt::format("'{}' by {:.{}f}", spec.name, change, change < 10 ? 2 : 0)
              : fmt::format("'{}' without end (at one end of its range the physics breaks down)", spec.name));
      continue;
    }
    findings.push_back(
        {.check = "parameter_effect",
         .severity = Severity::kWarning,
         .what = fmt::format("parameter '{}' ({}) changes nothing in the replayed episodes between {} and {}",
                             spec.name, spec.field, spec.low, spec.high),
         .count = 1,
         .meaning = "the logs cannot show it: it will be not identified",
         .remedy = "check the path, or leave the parameter out"});
  }
  if (seen.empty()) return;
  findings.push_back(
      {.check = "parameter_effect",
       .severity = Severity::kNote,
       .what = fmt::format("over their ranges parameters move the replayed episodes, in standard deviations "
                           "of a channel: {}",
                           fmt::join(seen, ", ")),
       .count = static_cast<int64_t>(seen.size()),
       .meaning = "the logs show each of them alone; whether they tell them apart the design says",
       .remedy = "none needed"});
}

}  // namespace

std::string ToString(GapVerdict verdict) {
  switch (verdict) {
    case GapVerdict::kNone:
      return "none";
    case GapVerdict::kSmall:
      return "small";
    case GapVerdict::kClear:
      return "clear";
    case GapVerdict::kUnknown:
      return "unknown";
  }
  return "";
}

GapVerdict DataCheck::Verdict() const {
  if (!gap || is_little) return GapVerdict::kUnknown;
  if (gap->auc < kSmallAuc) return GapVerdict::kNone;
  if (gap_by_clone) return GapVerdict::kUnknown;
  return gap->auc < kClearAuc ? GapVerdict::kSmall : GapVerdict::kClear;
}

namespace {

void AddEngine(const EngineMatch& better, const OneStepError& here, const SimulatorSpec& spec,
               std::vector<Finding>& findings) {
  findings.push_back(
      {.check = "other_engine",
       .severity = Severity::kWarning,
       .what =
           fmt::format("the logged steps repeat in {} with a median error of {:.2g} of the change, in {} with {:.2g}",
                       better.task, better.ratio, spec.task, here.median_ratio),
       .count = here.n_rows,
       .meaning = "the logs were recorded with another version of the task; in this one that looks like a gap in the "
                  "parameters",
       .remedy = fmt::format("use --task {} (docs/legacy_engine.md)", better.task)});
}

}  // namespace

TaskFacts FactsOf(const SimulatorSpec& spec) {
  TaskFacts facts;
  facts.observation_names = spec.observation_names;
  facts.action_names = spec.action_names;
  facts.rate_of = spec.rate_of;
  facts.bodies = spec.bodies;
  std::set<int> positions(spec.rate_of.begin(), spec.rate_of.end());
  for (const HiddenCoordinate& hidden : spec.hidden) positions.insert(hidden.rate_of);
  positions.erase(-1);
  std::erase_if(positions, [&](int j) {  // metres have no whole turn
    const size_t at = static_cast<size_t>(j);
    return at < spec.observation_units.size() && spec.observation_units[at] == "m";
  });
  for (const TurningBody& body : spec.bodies) {
    for (const int j : body.position) positions.erase(j);
  }
  facts.positions.assign(positions.begin(), positions.end());
  std::ranges::copy_if(facts.positions, std::back_inserter(facts.radians), [&](int j) {
    const size_t at = static_cast<size_t>(j);
    return at < spec.observation_units.size() && spec.observation_units[at] == "rad";
  });
  facts.control_period_s = spec.control_period_s;
  facts.action_low = spec.action_low;
  facts.action_high = spec.action_high;
  for (size_t k = 0; k < spec.bounds_action.size(); ++k) {
    if (spec.bounds_action[k] != 0) continue;
    facts.action_low[k] = -std::numeric_limits<double>::infinity();
    facts.action_high[k] = std::numeric_limits<double>::infinity();
  }
  facts.max_episode_steps = spec.max_episode_steps;
  facts.flat_observations =
      spec.observation_shape.size() == 1 && spec.image_shape.empty() && spec.observation_levels.empty();
  facts.continuous_actions = spec.n_discrete_actions == 0;
  return facts;
}

std::vector<std::string> DataWarnings(const Dataset& dataset, const SimulatorSpec& spec, Concern most) {
  std::vector<std::string> warnings;
  for (const Finding& f : CheckDataset(dataset, FactsOf(spec))) {
    if (f.concern > most) continue;
    if (f.check == kImpossibleMotion) throw DataError(fmt::format("{}; {}", f.what, f.remedy));
    if (f.severity != Severity::kNote) warnings.push_back(fmt::format("data, {}: {}; {}", f.check, f.what, f.meaning));
  }
  return warnings;
}

std::vector<Finding> FindCorrections(const SimulatorFactory& factory, const Dataset& dataset,
                                     const RunContext& context) {
  if (!factory.spec().can_replay() || !factory.spec().image_shape.empty()) return {};
  std::vector<Finding> findings = CheckDataset(dataset, FactsOf(factory.spec()));
  const auto n_before = static_cast<std::ptrdiff_t>(findings.size());
  CheckCorrections(factory, dataset, context, findings);
  findings.erase(findings.begin(), findings.begin() + n_before);
  if (factory.spec().can_set_state) {
    auto shift = FindShift(MeasureOneStep(factory, dataset, kOneStepRows, context.n_threads), factory);
    // What comes late a design suspects by itself, and says how late.
    if (shift && !shift->may_be_parameter) findings.push_back(*std::move(shift));
  }
  return findings;
}

std::string CorrectionWarning(const Finding& correction) {
  return fmt::format("data, {}: {}; {}", correction.check, correction.what, correction.remedy);
}

DataCheck CheckData(const Dataset& dataset, const SimulatorFactory* factory, uint64_t seed, const RunContext& context) {
  const TaskFacts facts = factory != nullptr ? FactsOf(factory->spec()) : TaskFacts{};
  DataCheck check;
  check.findings = CheckDataset(dataset, facts);
  const auto is_unusable = [](const Finding& f) { return f.check == "not_finite" || f.check == "malformed"; };
  if (std::any_of(check.findings.begin(), check.findings.end(), is_unusable)) return check;
  if (facts.flat_observations && facts.continuous_actions) check.noise = EstimateNoise(dataset);
  if (factory == nullptr) return check;

  const SimulatorSpec& spec = factory->spec();
  try {
    dataset.CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  } catch (const DataError& e) {
    check.findings.push_back({.check = "wrong_dimensions",
                              .severity = Severity::kError,
                              .what = e.what(),
                              .count = 1,
                              .meaning = "the data are not this task's; the checks with a simulator were not made",
                              .remedy = "name the task that the data were logged from"});
    return check;
  }
  const RngKey key = RngKey(seed).Stage("data check");
  if (factory->parameters().size() > 0) {
    CheckEffects(*factory, dataset, key.Stage("effects"), context.n_threads, check.findings);
  }
  if (dataset.size() < 2) return check;  // nothing to compare with anything: little_data tells
  const JudgeHalves halves = SplitForJudge(dataset);
  if (spec.can_set_state) {
    CheckTerminals(*factory, dataset, check.noise, key.Stage("terminals"), check.findings);
    check.one_step = MeasureOneStep(*factory, dataset, kOneStepRows, context.n_threads);
    AddOneStep(*check.one_step, *factory, check.noise, check.findings);
    const auto better = FindBetterEngine(spec.task, *check.one_step, dataset, kOneStepRows, context.n_threads);
    if (better) AddEngine(*better, *check.one_step, spec, check.findings);
    const bool all_late =
        std::ranges::any_of(check.findings, [](const Finding& f) { return f.check == kShiftedActions; });
    if (!all_late) CheckLateRecordings(*factory, dataset, kOneStepRows, context.n_threads, check.findings);
    CheckCorrections(*factory, dataset, context, check.findings);
    if (check.one_step->n_rows == 0) return check;  // a judge would start from the same states
    try {
      check.gap =
          JudgeReplays(*factory, halves, {factory->parameters().Nominal()}, kGapSteps, kJudgeSteps, key.Stage("gap"));
    } catch (const DataError&) {
      return check;  // one half alone has no state that can be set: clipped_observations tells
    }
  } else if (spec.can_replay()) {
    CheckCorrections(*factory, dataset, context, check.findings);
    check.findings.push_back({.check = "gap",
                              .severity = Severity::kNote,
                              .what =
                                  "not measured: the logs do not show whole states, so the nominal simulator cannot "
                                  "go on from theirs",
                              .count = dataset.size(),
                              .meaning = "whether there is a gap a design shows: it finds the states, too",
                              .remedy = "oted design"});
    return check;
  } else {
    const CloneResult clone = CloneBehavior({dataset, spec, {}, key.Stage("clone"), "check", context});
    const EvidenceConfig evidence = CommonEvidence(spec, kGapSteps);
    check.gap = JudgeSimulator(*factory, {halves, clone.policy.get(), evidence, kJudgeSteps},
                               {factory->parameters().Nominal()}, key.Stage("gap"));
    check.gap_by_clone = true;
  }
  if (check.gap->n_simulated == 0) {
    check.gap.reset();
    check.findings.push_back({.check = "gap",
                              .severity = Severity::kWarning,
                              .what = fmt::format("the nominal {} broke down in every replay of the logs", spec.task),
                              .count = dataset.size(),
                              .meaning = "logs and simulator could not be compared",
                              .remedy = "correct the model, or the units of the logs"});
    return check;
  }
  AddGap(spec, dataset.size(), check);
  return check;
}

}  // namespace oted
