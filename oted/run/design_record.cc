#include "oted/run/design_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numbers>

#include "oted/matching/verdict.h"

namespace oted {

using nlohmann::json;

namespace {

json FitRecord(const FitEvidence& fit, const std::vector<std::string>& names) {
  json record = {{"window", fit.window},
                 {"explained", fit.explained},
                 {"channels", json::array()},
                 {"suspects", ToJson(fit.suspects)}};
  const std::vector<int> disagreeing = DisagreeingChannels(fit);
  for (size_t c = 0; c < fit.noise_std.size(); ++c) {
    record["channels"].push_back(
        {{"name", c < names.size() ? names[c] : fmt::format("obs[{}]", c)},
         {"noise_std", fit.noise_std[c]},
         {"short_noise_std", fit.short_noise_std[c]},
         {"long_noise_std", fit.long_noise_std[c]},
         {"disagrees", std::ranges::find(disagreeing, static_cast<int>(c)) != disagreeing.end()}});
  }
  return record;
}

/// The design whose fit tells of the whole: the selected setting's best, or that of the first method which it stands
/// for.
const Candidate& ToldBy(const std::vector<Candidate>& candidates, const SelectionResult& result,
                        const std::vector<MethodChoice>& choices) {
  std::string setting = result.settings[static_cast<size_t>(result.selected_setting)].setting;
  for (const MethodChoice& choice : choices) {
    if (choice.picked == setting) setting = choice.setting;
  }
  const auto of = std::ranges::find(result.settings, setting, &SettingScore::setting);
  return candidates[static_cast<size_t>(of->best_candidate)];
}

}  // namespace

json DesignRecord(const RunConfig& config, const ParameterSpace& space, const std::vector<Candidate>& candidates,
                  const SelectionResult& result, const std::vector<MethodChoice>& choices,
                  const std::vector<bool>& has_effect, const std::vector<std::string>& channels) {
  const SettingScore& selected = result.settings[static_cast<size_t>(result.selected_setting)];
  std::vector<Designer> mixture;
  int best = 0;
  json mixture_json = json::array();
  for (const int i : selected.candidates) {
    const Candidate& candidate = candidates[static_cast<size_t>(i)];
    if (i == result.best_candidate) best = static_cast<int>(mixture.size());
    mixture.push_back(candidate.q);
    mixture_json.push_back({{"seed", candidate.seed}, {"mode", candidate.q.Mode()}, {"std", candidate.q.Std()}});
  }
  const auto summaries = SummarizeParameters(mixture, best, has_effect);
  const Candidate& told_by = ToldBy(candidates, result, choices);
  const std::optional<FitEvidence>& fit = told_by.fit;
  DesignVerdict verdict = fit ? JudgeFit(told_by.q, *fit) : JudgeDesign(result.nominal_common, selected.common);
  // The judge may be blind to a gap that the parameters show.
  if (!fit && verdict == DesignVerdict::kNoGap && HasMoved(space, summaries)) verdict = DesignVerdict::kGapClosed;

  json design;
  design["schema"] = "oted.design/1";
  design["task"] = config.task.name;
  design["warnings"] = json::array();
  const std::vector<int> at_bounds = ParametersAtBounds(told_by.q);
  for (int i = 0; i < space.size(); ++i) {
    const ParameterSpec& spec = space[i];
    const ParameterSummary& s = summaries[static_cast<size_t>(i)];
    design["parameters"].push_back({{"name", spec.name},
                                    {"field", spec.field},
                                    {"unit", spec.unit},
                                    {"nominal", spec.nominal},
                                    {"bounds", {spec.low, spec.high}},
                                    {"mode", s.mode},
                                    {"std", s.std},
                                    {"interval90", {s.interval90_low, s.interval90_high}},
                                    {"verdict", ToString(s.verdict)}});
    if (!has_effect[static_cast<size_t>(i)]) {
      design["warnings"].push_back(
          fmt::format("parameter '{}' has no measured effect on the logged episodes", spec.name));
    }
    if (fit && std::ranges::find(at_bounds, i) != at_bounds.end()) {
      design["warnings"].push_back(
          fmt::format("parameter '{}' ended at a bound of its range [{:g}, {:g}]: the target may lie beyond it",
                      spec.name, spec.low, spec.high));
    }
    const Eigen::VectorXd row = mixture[static_cast<size_t>(best)].Correlation().row(i);
    design["correlation"].push_back(std::vector<double>(row.begin(), row.end()));
  }
  design["selected"] = selected.setting;
  design["mixture"] = mixture_json;
  design["score"] = config.selection.score == "paper" ? selected.c : selected.common;
  design["score_name"] = config.selection.score;
  design["verdict"] = ToString(verdict);
  if (fit) {
    design["fit"] = FitRecord(*fit, channels);
    // What a parameter may not do for its bound, others seem to ask for.
    if (!at_bounds.empty()) design["fit"]["suspects"] = json::array();
  }
  for (const MethodChoice& choice : choices) design["method_choices"].push_back(ToJson(choice));
  design["log2"] = std::numbers::ln2;
  design["nominal_common"] = result.nominal_common;
  for (const SettingScore& setting : result.settings) {
    json seeds = json::array();
    for (const int i : setting.candidates) {
      const Candidate& candidate = candidates[static_cast<size_t>(i)];
      const CandidateScore& score = result.candidates[static_cast<size_t>(i)];
      seeds.push_back({{"seed", candidate.seed},
                       {"mode", candidate.q.Mode()},
                       {"std", candidate.q.Std()},
                       {"c", score.c},
                       {"common", score.common},
                       {"learning_progress", candidate.learning_progress}});
    }
    design["settings"].push_back({{"name", setting.setting},
                                  {"method", candidates[static_cast<size_t>(setting.candidates[0])].method},
                                  {"c", setting.c},
                                  {"common", setting.common},
                                  {"design_deviation", setting.design_deviation},
                                  {"learning_progress", setting.learning_progress},
                                  {"seeds", seeds}});
  }
  return design;
}

}  // namespace oted
