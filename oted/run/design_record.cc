#include "oted/run/design_record.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/matching/verdict.h"

namespace oted {
namespace {

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

/// The design whose fit tells of the whole: the selected setting's best, or that of the first method which it stands
/// for.
const Candidate& ToldBy(const DesignFindings& findings) {
  const SelectionResult& result = findings.result;
  std::string setting = result.settings[static_cast<size_t>(result.selected_setting)].setting;
  for (const MethodChoice& choice : findings.choices) {
    if (choice.picked == setting) setting = choice.setting;
  }
  const auto of = std::ranges::find(result.settings, setting, &SettingScore::setting);
  return findings.candidates[static_cast<size_t>(of->best_candidate)];
}

DesignRecord::Fit FitOf(const FitEvidence& fit, const std::vector<std::string>& names) {
  DesignRecord::Fit record{fit.window, fit.explained, {}, fit.suspects};
  const std::vector<int> disagreeing = DisagreeingChannels(fit);
  for (size_t c = 0; c < fit.noise_std.size(); ++c) {
    record.channels.push_back({c < names.size() ? names[c] : fmt::format("obs[{}]", c), fit.noise_std[c],
                               fit.short_noise_std[c], fit.long_noise_std[c],
                               std::ranges::find(disagreeing, static_cast<int>(c)) != disagreeing.end()});
  }
  return record;
}

DesignRecord::Validation ValidationOf(const HeldOutPrediction& prediction, const FitEvidence& fit,
                                      const SimulatorSpec& spec) {
  DesignRecord::Validation validation{prediction.n_windows, {}};
  for (const HeldOutPrediction::Horizon& h : prediction.horizons) {
    DesignRecord::Validation::Horizon horizon{h.seconds, {}};
    for (size_t c = 0; c < h.nominal.size(); ++c) {
      horizon.channels.push_back(
          {c < spec.observation_names.size() ? spec.observation_names[c] : fmt::format("obs[{}]", c),
           c < spec.observation_units.size() ? spec.observation_units[c] : "", h.nominal[c], h.designed[c],
           fit.short_noise_std[c]});
    }
    validation.horizons.push_back(std::move(horizon));
  }
  return validation;
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
                                 .mode = s.mode,
                                 .std = s.std,
                                 .interval90_low = s.interval90_low,
                                 .interval90_high = s.interval90_high,
                                 .verdict = s.verdict});
  }
}

/// @param at_bounds  parameters that ended at a bound; empty where no fit tells
void AddWarnings(const ParameterSpace& space, const std::vector<bool>& has_effect, const std::vector<int>& at_bounds,
                 DesignRecord& record) {
  for (int i = 0; i < space.size(); ++i) {
    const ParameterSpec& spec = space[i];
    if (!has_effect[static_cast<size_t>(i)]) {
      record.warnings.push_back(fmt::format("parameter '{}' has no measured effect on the logged episodes", spec.name));
    }
    if (std::ranges::find(at_bounds, i) != at_bounds.end()) {
      record.warnings.push_back(
          fmt::format("parameter '{}' ended at a bound of its range [{:g}, {:g}]: the true value may lie beyond",
                      spec.name, spec.low, spec.high));
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

}  // namespace

DesignRecord MakeDesignRecord(const RunSetup& run, const DesignFindings& findings) {
  const ParameterSpace& space = run.parameters();
  const SettingScore& selected = findings.result.settings[static_cast<size_t>(findings.result.selected_setting)];
  const Mixture mixture = SelectedMixture(findings);
  const auto summaries = SummarizeParameters(mixture.q, mixture.best, findings.has_effect);
  const Candidate& told_by = ToldBy(findings);
  const std::optional<FitEvidence>& fit = told_by.fit;
  const std::vector<int> at_bounds = fit ? ParametersAtBounds(told_by.q) : std::vector<int>{};

  DesignRecord record;
  record.task = run.config.task.name;
  AddParameters(space, summaries, record);
  AddWarnings(space, findings.has_effect, at_bounds, record);
  const Eigen::MatrixXd correlation = mixture.q[static_cast<size_t>(mixture.best)].Correlation();
  for (int i = 0; i < space.size(); ++i) {
    const Eigen::VectorXd row = correlation.row(i);
    record.correlation.emplace_back(row.begin(), row.end());
  }
  record.selected = selected.setting;
  record.mixture = mixture.members;
  record.score_name = run.config.selection.score;
  record.score = record.score_name == SelectionScore::kPaper ? selected.c : selected.common;
  record.verdict = fit ? JudgeFit(told_by.q, *fit) : JudgeDesign(findings.result.nominal_common, selected.common);
  // The judge may be blind to a gap that the parameters show.
  const bool moved_unseen = !fit && record.verdict == DesignVerdict::kNoGap && HasMoved(space, summaries);
  if (moved_unseen) record.verdict = DesignVerdict::kGapClosed;
  if (fit) record.fit = FitOf(*fit, run.spec().observation_names);
  if (fit && fit->held_out) record.validation = ValidationOf(*fit->held_out, *fit, run.spec());
  // What a parameter may not do for its bound, others seem to ask for.
  if (!at_bounds.empty()) record.fit->suspects.clear();
  record.method_choices = findings.choices;
  record.nominal_common = findings.result.nominal_common;
  AddSettings(findings, record);
  record.dataset = {run.config.data.path, run.dataset.sha256, run.dataset.size()};
  record.model_sha256 = run.model_sha256;
  record.oted_version = OTED_VERSION;
  record.mujoco_version = "4.0.0";
  return record;
}

}  // namespace oted
