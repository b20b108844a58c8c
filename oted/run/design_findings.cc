#include "oted/run/design_findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <ranges>

#include "oted/checks/data_check.h"
#include "oted/config/parameters_toml.h"
#include "oted/matching/verdict.h"
#include "oted/run/fingerprint.h"
#include "oted/run/prediction_words.h"
#include "oted/run/suspect_sentence.h"
#include "oted/run/verdict_sentence.h"
#include "oted/sim/mujoco/version.h"

namespace oted {
namespace {

constexpr double kFar = 10, kFarWhereGrown = 4;  // small changes: a half, a fifth of a value

/// The designs of the selected setting.
struct Mixture {
  std::vector<DesignRecord::Member> members;
  std::vector<Designer> q;
  int best = 0;  ///< of them
};

Mixture SelectedMixture(const DesignFindings& findings) {
  Mixture mixture;
  for (const int i : findings.result.settings[static_cast<size_t>(findings.result.selected_setting)].candidates) {
    const Candidate& candidate = findings.candidates[static_cast<size_t>(i)];
    if (i == findings.result.best_candidate) mixture.best = static_cast<int>(mixture.q.size());
    mixture.q.push_back(candidate.q);
    mixture.members.push_back({candidate.seed, candidate.q.Mode(), candidate.q.Std()});
  }
  return mixture;
}

std::string ChannelName(const SimulatorSpec& spec, size_t c) {
  return c < spec.observation_names.size() ? spec.observation_names[c] : fmt::format("obs[{}]", c);
}

std::string ChannelUnit(const SimulatorSpec& spec, size_t c) {
  return c < spec.observation_units.size() ? spec.observation_units[c] : "";
}

/// DesignRecord::period_sentence.
std::string PeriodSentence(const Dataset& logs, const SimulatorSpec& spec) {
  const bool is_told =
      logs.period_s > 0 || std::ranges::any_of(spec.rate_of, [](int position) { return position >= 0; });
  if (is_told || !(spec.control_period_s > 0)) return "";
  return fmt::format(
      "all values: if the control period is {:g} s, as the task says. These logs hold neither times nor velocities, "
      "which would tell; with another period masses, dampings and forces would be others",
      spec.control_period_s);
}

/// That the logs do not tell on which side of 0 a value lies.
std::string SideSentence(const std::string& parameter) {
  return fmt::format(
      "the logs are as likely with the negative of '{}': they do not tell on which side of 0 it lies, and its interval "
      "holds both; narrow its range to the side that you know, or log a motion that tells them apart",
      parameter);
}

/// What designs from the design's own logs found of each parameter.
/// @param unsettled  FitEvidence::unsettled
std::string OwnLogsSentence(const ParameterSpace& space, const std::vector<std::vector<double>>& found,
                            const std::vector<int>& unsettled) {
  std::vector<std::string> ranges;
  for (int i = 0; i < space.size(); ++i) {
    const auto value = [i](const std::vector<double>& z) { return z[static_cast<size_t>(i)]; };
    const auto [least, most] = std::ranges::minmax(found | std::views::transform(value));
    ranges.push_back(fmt::format("{} {:.3g} to {:.3g}", space[i].name, least, most));
  }
  std::string so = "every interval covers these";
  if (unsettled.size() == static_cast<size_t>(space.size())) {
    so = "with contacts and noise many stretches may as well have begun otherwise: any value may be farther off "
         "than its interval says";
  } else if (!unsettled.empty()) {
    std::vector<std::string> names;
    for (const int i : unsettled) names.push_back(space[i].name);
    so += fmt::format(", and {} {} at most weak, as these lie far from the design's", fmt::join(names, ", "),
                      names.size() == 1 ? "is" : "are");
  }
  return fmt::format(
      "own logs: from {} logs that the designed simulator made at these values the same method finds {}; {}",
      found.size(), fmt::join(ranges, ", "), so);
}

/// Names and units, and the floor where it was looked for over that horizon.
std::vector<DesignRecord::Validation::Channel> ChannelsOver(double seconds, const SimulatorSpec& spec,
                                                            const std::optional<HeldOutPrediction>& prediction) {
  std::vector<DesignRecord::Validation::Channel> channels;
  for (size_t c = 0; c < static_cast<size_t>(spec.obs_dim()); ++c) {
    channels.push_back({ChannelName(spec, c), ChannelUnit(spec, c)});
    if (!prediction) continue;
    for (const HeldOutPrediction::Horizon& h : prediction->horizons) {
      if (h.seconds == seconds) channels.back().floor = h.channels[c].floor;
    }
  }
  return channels;
}

/// @param off  the channels in which more is left than the sensors explain
DesignRecord::Fit FitOf(const FitEvidence& fit, const std::vector<Suspect>& suspects, const std::vector<int>& off,
                        const SimulatorSpec& spec, const std::optional<HeldOutPrediction>& prediction) {
  DesignRecord::Fit record{fit.window, fit.explained, {}, {}, fit.left_out};
  for (size_t c = 0; c < fit.noise_std.size(); ++c) {
    record.channels.push_back({ChannelName(spec, c), fit.noise_std[c], fit.short_noise_std[c], fit.long_noise_std[c],
                               std::ranges::find(off, static_cast<int>(c)) != off.end()});
  }
  for (const Suspect& suspect : suspects) {
    const auto channels = ChannelsOver(suspect.trial ? suspect.trial->seconds : 0, spec, prediction);
    record.suspects.push_back({suspect, SuspectSentence(suspect, channels, off), ParameterLine(suspect.spec)});
  }
  return record;
}

void AddParameters(const ParameterSpace& space, const std::vector<ParameterSummary>& summaries, DesignRecord& record) {
  for (int i = 0; i < space.size(); ++i) {
    const ParameterSpec& spec = space[i];
    const ParameterSummary& s = summaries[static_cast<size_t>(i)];
    record.parameters.push_back({.name = spec.name,
                                 .field = spec.field,
                                 .unit = spec.unit,
                                 .nominal = spec.nominal,
                                 .low = spec.low,
                                 .high = spec.high,
                                 .logarithmic = spec.logarithmic,
                                 .mode = s.mode,
                                 .std = s.std,
                                 .interval90_low = s.interval90_low,
                                 .interval90_high = s.interval90_high,
                                 .verdict = s.verdict});
  }
}

/// What the parameters' values rest on, by the fit that found them.
void AddConditions(const FitEvidence& fit, DesignRecord& record) {
  for (const Condition& condition : fit.conditions) {
    record.parameters[static_cast<size_t>(condition.parameter)].rests_on.push_back(
        {condition.spec.name, condition.spec.field, condition.off, condition.value, ConditionInWords(condition)});
  }
}

/// @param asked_beyond  ParametersAtBounds of the best design
void AddWarnings(const ParameterSpace& space, const std::vector<bool>& has_effect, const std::vector<int>& asked_beyond,
                 DesignRecord& record) {
  for (int i = 0; i < space.size(); ++i) {
    const ParameterSpec& spec = space[i];
    if (!has_effect[static_cast<size_t>(i)]) {
      record.warnings.push_back(fmt::format("parameter '{}' has no measured effect on the logged episodes", spec.name));
    }
    const DesignRecord::Parameter& p = record.parameters[static_cast<size_t>(i)];
    if (p.verdict == ParameterVerdict::kAtBound) {
      record.warnings.push_back(
          fmt::format("parameter '{}' ended at a bound of its range [{:g}, {:g}]: the true value may lie beyond",
                      spec.name, spec.low, spec.high));
    } else if (EndsAtBound(spec, p.mode, p.mode)) {
      record.warnings.push_back(fmt::format(
          "parameter '{}' has its value at the end of its range [{:g}, {:g}], {}", spec.name, spec.low, spec.high,
          std::ranges::count(asked_beyond, i) > 0
              ? "though with a suspect freed it may be elsewhere; widen the range, or free that suspect"
              : "though the logs hardly tell it; widen the range, or fix the parameter where you trust it"));
    }
  }
}

void AddSettings(const DesignFindings& findings, DesignRecord& record) {
  for (const SettingScore& scored : findings.result.settings) {
    DesignRecord::Setting setting;
    setting.name = scored.setting;
    setting.method = findings.candidates[static_cast<size_t>(scored.candidates[0])].method;
    setting.c = scored.c;
    setting.common = scored.common;
    setting.design_deviation = scored.design_deviation;
    setting.learning_progress = scored.learning_progress;
    for (const int i : scored.candidates) {
      const Candidate& candidate = findings.candidates[static_cast<size_t>(i)];
      const CandidateScore& score = findings.result.candidates[static_cast<size_t>(i)];
      DesignRecord::Seed seed;
      seed.seed = candidate.seed;
      seed.mode = candidate.q.Mode();
      seed.std = candidate.q.Std();
      seed.c = score.c;
      seed.common = score.common;
      seed.learning_progress = candidate.learning_progress;
      setting.seeds.push_back(std::move(seed));
    }
    record.settings.push_back(std::move(setting));
  }
}

/// The whole design's verdict, and what it rests on.
struct Judgement {
  DesignVerdict verdict = DesignVerdict::kNoGap;
  bool reaches_floor = false, better = false;
  std::vector<int> off;  ///< channels in which more is left than sensors explain
};

/// Whether the fit that leaves some recording out predicts it surely worse than the nominal simulator. The logs that
/// judge are of motions like those that taught.
bool FailsInARecording(const Candidate& best) {
  return best.fit && best.fit->left_out && !best.fit->left_out->WorseRecordings().empty();
}

/// Whether the logs surely ask for something that is not searched.
bool AskForMore(const std::vector<Suspect>& suspects) { return std::ranges::any_of(suspects, &Suspect::IsLikely); }

/// What does not depend on how far each parameter is known; with the verdict where a classifier decides.
/// @param suspects  of the best design
Judgement Judge(const Candidate& best, const std::vector<Suspect>& suspects, std::optional<double> nominal_common,
                std::optional<double> designed_common, int n_transitions) {
  Judgement judgement;
  if (best.prediction) {
    judgement.better = PredictsBetter(*best.prediction);
    // What else is off moves every value, also one that the fit with it leaves in its place.
    judgement.reaches_floor = ReachesFloor(*best.prediction) && !FailsInARecording(best) && !AskForMore(suspects);
    judgement.off = ChannelsOff(*best.prediction);
    return judgement;
  }
  judgement.verdict = JudgeDesign(nominal_common.value(), designed_common.value(), n_transitions);
  judgement.better = !IsNegative(judgement.verdict);
  judgement.reaches_floor = FloorIsReached(judgement.verdict);
  return judgement;
}

/// @param suspects  of the best design
FitDoubts DoubtsOf(const Candidate& best, const std::vector<Suspect>& suspects,
                   const std::vector<ParameterSummary>& summaries) {
  FitDoubts doubts{ParametersAtBounds(best.q), FailsInARecording(best), AskForMore(suspects)};
  // Where the logs are as likely with something else freed, and the value inside its range then, they ask for nothing
  // beyond it.
  std::erase_if(doubts.at_bounds,
                [&](int i) { return summaries[static_cast<size_t>(i)].verdict != ParameterVerdict::kAtBound; });
  return doubts;
}

/// What parameters may be as well: with each suspect freed that does not surely predict worse. Which of them is off, or
/// something that nobody suspects, the logs do not say.
std::vector<std::vector<SearchInterval>> IntervalsOfFreed(const std::vector<Suspect>& suspects) {
  std::vector<std::vector<SearchInterval>> intervals;
  for (const Suspect& suspect : suspects) {
    if (!suspect.trial || IsSureLoss(suspect.trial->gain)) continue;
    intervals.push_back(suspect.trial->intervals90);
  }
  return intervals;
}

/// An interval that says nothing.
constexpr SearchInterval kNothing{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};

/// What parameters may be as well on the other side of 0, where the logs do not tell the side.
std::vector<std::vector<SearchInterval>> IntervalsOfMirrored(const FitEvidence& fit, size_t n_parameters) {
  if (fit.mirrored.empty()) return {};
  std::vector<SearchInterval> intervals(n_parameters, kNothing);
  for (const MirroredValue& value : fit.mirrored) intervals[static_cast<size_t>(value.parameter)] = value.interval90;
  return {intervals};
}

/// The same where --grow added one suspect and the logs are as likely with another: with that, the one added is as the
/// model has it, and what was added later is not known.
std::vector<std::vector<SearchInterval>> IntervalsOfRivals(const std::vector<Disputed>& all, size_t n_parameters) {
  std::vector<std::vector<SearchInterval>> intervals_of_all;
  for (const auto& [added, rival] : all) {
    std::vector<SearchInterval> intervals = rival->trial->intervals90;
    intervals.push_back({added->spec.nominal, added->spec.nominal});
    intervals.resize(n_parameters, kNothing);
    intervals_of_all.push_back(std::move(intervals));
  }
  return intervals_of_all;
}

DesignRecord::Validation::Horizon HorizonInRecord(const HeldOutPrediction::Horizon& h, const SimulatorSpec& spec) {
  DesignRecord::Validation::Horizon horizon{
      h.seconds,         h.n_steps, h.n_windows, h.learned,         1 - std::exp(-0.5 * h.gain.value),
      IsSurelyBetter(h), {},        {},          MostTimesFloor(h), h.odd_episodes};
  for (size_t c = 0; c < h.channels.size(); ++c) {
    horizon.channels.push_back({ChannelName(spec, c), ChannelUnit(spec, c), h.channels[c].nominal,
                                h.channels[c].designed, h.channels[c].floor, h.channels[c].spread, h.channels[c].judged,
                                h.channels[c].guess,
                                h.channels[c].in_some ? std::exp(0.5 * h.channels[c].excess.value) : 0});
  }
  if (h.n_of_recordings > 0) {
    horizon.in_recordings = {h.n_of_recordings, 1 - std::exp(-0.5 * h.gain_of_recordings.value),
                             IsSure(h.gain_of_recordings)};
  }
  return horizon;
}

}  // namespace

DesignRecord::Validation InRecord(const HeldOutPrediction& prediction, const SimulatorSpec& spec) {
  DesignRecord::Validation validation;
  validation.n_recordings = prediction.n_recordings;
  validation.n_parts = prediction.n_parts;
  for (const HeldOutPrediction::Horizon& h : prediction.horizons)
    validation.horizons.push_back(HorizonInRecord(h, spec));
  if (prediction.longest) validation.longest = HorizonInRecord(*prediction.longest, spec);
  return validation;
}

void WeakenWhatMovesFar(const ParameterSpace& space, DesignRecord& record) {
  const double far = record.grown.empty() ? kFar : kFarWhereGrown;
  for (int i = 0; i < space.size(); ++i) {
    DesignRecord::Parameter& p = record.parameters[static_cast<size_t>(i)];
    const bool is_imitated = record.WasGrown(space[i].name) && space[i].field.starts_with("body/");
    const double most = far * SmallChange(space[i], p.mode);
    const bool is_moved = std::ranges::any_of(
        p.rests_on, [&](const DesignRecord::RestsOn& other) { return std::abs(other.value - p.mode) > most; });
    if ((is_moved || is_imitated) && p.verdict == ParameterVerdict::kIdentified) p.verdict = ParameterVerdict::kWeak;
  }
}

size_t ToldBy(const DesignFindings& findings) {
  const SelectionResult& result = findings.result;
  std::string setting = result.settings[static_cast<size_t>(result.selected_setting)].setting;
  for (const MethodChoice& choice : findings.choices) {
    if (choice.picked == setting) setting = choice.setting;
  }
  const auto of = std::ranges::find(result.settings, setting, &SettingScore::setting);
  return static_cast<size_t>(of->best_candidate);
}

DesignRecord MakeDesignRecord(const RunSetup& run, const DesignFindings& findings) {
  const ParameterSpace& space = run.parameters();
  const SettingScore& selected = findings.result.settings[static_cast<size_t>(findings.result.selected_setting)];
  const Mixture mixture = SelectedMixture(findings);
  const Candidate& best = findings.candidates[static_cast<size_t>(findings.result.best_candidate)];
  const Judgement judgement =
      Judge(best, findings.suspects, findings.result.nominal_common, selected.common, run.dataset.size());
  const auto open_ends = best.prediction ? best.prediction->open_ends : std::vector<HeldOutPrediction::OpenEnd>();
  std::vector<std::vector<SearchInterval>> otherwise = IntervalsOfFreed(findings.suspects);
  const std::vector<Disputed> disputed = DisputedIn(run.growth);
  std::ranges::move(IntervalsOfRivals(disputed, static_cast<size_t>(space.size())), std::back_inserter(otherwise));
  if (best.fit) {
    std::ranges::move(IntervalsOfMirrored(*best.fit, static_cast<size_t>(space.size())), std::back_inserter(otherwise));
  }
  auto summaries =
      SummarizeParameters(mixture.q, mixture.best, findings.has_effect, judgement.reaches_floor, open_ends, otherwise);
  const bool can_tell = !best.prediction || judgement.better || !judgement.reaches_floor;
  WeakenDoubted(space, can_tell, best.fit ? best.fit->unsettled : std::vector<int>(), summaries);

  DesignRecord record;
  record.task = run.config.task.name;
  record.dataset = {run.config.data.Files(), run.dataset.sha256, run.dataset.size()};
  AddParameters(space, summaries, record);
  if (best.fit) AddConditions(*best.fit, record);
  for (const Finding& correction : findings.corrections) record.warnings.push_back(CorrectionWarning(correction));
  record.period_sentence = PeriodSentence(run.dataset, run.spec());
  record.columns_seem_wrong = CountOf(findings.corrections, Severity::kWarning) > 0;
  if (best.fit) {
    for (const MirroredValue& value : best.fit->mirrored) {
      DesignRecord::Parameter& parameter = record.parameters[static_cast<size_t>(value.parameter)];
      parameter.either_side = true;
      record.warnings.push_back(SideSentence(parameter.name));
    }
  }
  for (const auto& [added, rival] : disputed) record.warnings.push_back(RivalSentence(*added, *rival));
  AddWarnings(space, findings.has_effect, ParametersAtBounds(best.q), record);
  const Eigen::MatrixXd correlation = mixture.q[static_cast<size_t>(mixture.best)].Correlation();
  for (int i = 0; i < space.size(); ++i) {
    const Eigen::VectorXd row = correlation.row(i);
    record.correlation.emplace_back(row.begin(), row.end());
  }
  record.selected = selected.setting;
  record.mixture = mixture.members;
  record.score_name = run.config.selection.score;
  record.score = record.score_name == SelectionScore::kPaper ? selected.c : selected.common;
  record.verdict = best.prediction
                       ? JudgePrediction(best.q, *best.prediction, DoubtsOf(best, findings.suspects, summaries))
                       : judgement.verdict;
  // The judge may be blind to a gap that the parameters show.
  const bool moved_unseen = !best.prediction && record.verdict == DesignVerdict::kNoGap && HasMoved(space, summaries);
  if (moved_unseen) record.verdict = DesignVerdict::kGapClosed;
  if (const std::optional<FitEvidence>& fit = findings.candidates[ToldBy(findings)].fit) {
    record.fit = FitOf(*fit, findings.suspects, judgement.off, run.spec(), best.prediction);
    if (best.fit && !best.fit->own_logs.empty()) {
      record.fit->own_logs = {best.fit->own_logs, OwnLogsSentence(space, best.fit->own_logs, best.fit->unsettled)};
    }
  }
  for (const GrowthRecord& round : run.growth) {
    if (const Suspect* freed = round.Freed()) record.grown.push_back(*freed);
  }
  WeakenWhatMovesFar(space, record);
  if (best.prediction) record.validation = InRecord(*best.prediction, run.spec());
  record.predicts_better = judgement.better;
  record.method_choices = findings.choices;
  record.nominal_common = findings.result.nominal_common;
  AddSettings(findings, record);
  record.sentence = VerdictSentence(record, judgement.off);
  record.model_sha256 = run.model_sha256;
  record.inputs = InputsFingerprint({run.config, run.model_sha256, run.dataset.sha256}, space);
  record.oted_version = OTED_VERSION;
  record.mujoco_version = MujocoVersion();
  return record;
}

}  // namespace oted
