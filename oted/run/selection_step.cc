#include "oted/run/selection_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>

#include "oted/base/error.h"
#include "oted/checks/data_check.h"
#include "oted/matching/verdict.h"
#include "oted/run/artifacts.h"
#include "oted/run/design_findings.h"
#include "oted/run/growth_step.h"
#include "oted/run/kept_trials.h"
#include "oted/run/method_choice_step.h"

namespace oted {
namespace {

void Append(std::vector<Design>& designs, std::vector<Design> more) {
  std::move(more.begin(), more.end(), std::back_inserter(designs));
}

/// Designs by the methods that take the place of first ones, which are no longer eligible.
std::vector<Design> DesignByChosenMethods(RunSetup& run, const std::vector<MethodChoice>& choices,
                                          const CloneSource& clone, std::vector<Candidate>& candidates) {
  std::map<std::string, SettingDesigns> chosen;
  for (const MethodChoice& choice : choices) {
    if (choice.picked == choice.setting) continue;
    chosen.emplace(choice.picked, run.other_methods.at(choice.picked));
    for (Candidate& candidate : candidates) {
      if (candidate.setting == choice.setting) candidate.superseded = true;
    }
  }
  std::vector<Design> designs = MakeDesigns(run, chosen, clone);
  for (const Design& design : designs) candidates.push_back(AsCandidate(run, design));
  return designs;
}

/// What a design leaves need not be the model's fault: a joint's sign, say, is no parameter. Asked where it leaves more
/// than the sensors explain, at a bound as well.
std::vector<Finding> CorrectionsOf(const RunSetup& run, const std::optional<HeldOutPrediction>& prediction) {
  if (!prediction || !LeavesGap(*prediction)) return {};
  std::vector<Finding> corrections = FindCorrections(*run.factory, run.dataset, run.context);
  for (const Finding& correction : corrections) run.context.log->Warning(CorrectionWarning(correction));
  return corrections;
}

/// Stage 3 with the clone where it acts: in what a g is trained on, and where a judge cannot go on from logged states.
SelectionResult Scored(RunSetup& run, const CloneSource& clone, std::vector<Candidate>& candidates) {
  const auto uses = [&](const Candidate& of) { return of.g && UsesClone(run, run.Designs(of.setting).config); };
  const bool acts = AsksCommonJudge(candidates) && !run.spec().can_set_state;
  return SelectSimulator({*run.factory, run.dataset, acts || std::ranges::any_of(candidates, uses) ? clone() : nullptr,
                          run.config.selection, run.Key("simulator selection"), run.context},
                         candidates);
}

DesignRecord Select(RunSetup& run, const CloneSource& clone, std::vector<Design>& designs) {
  DesignFindings findings;
  for (const Design& design : designs) findings.candidates.push_back(AsCandidate(run, design));
  if (findings.candidates.size() == 1) Predict(run, findings.candidates.front());
  findings.result = Scored(run, clone, findings.candidates);
  // Auto decides by how the best design of a setting predicts, and the verdict by how the best of all does.
  for (const auto& [setting, asked] : run.config.DesignSettings()) {
    const auto scored = std::ranges::find(findings.result.settings, setting, &SettingScore::setting);
    if (!asked.method) Predict(run, findings.candidates[static_cast<size_t>(scored->best_candidate)]);
  }
  findings.choices = ChooseMethods(run, findings.candidates, findings.result, clone);
  std::vector<Design> more = DesignByChosenMethods(run, findings.choices, clone, findings.candidates);
  if (!more.empty()) findings.result = Scored(run, clone, findings.candidates);
  Append(designs, std::move(more));
  Predict(run, findings.candidates[static_cast<size_t>(findings.result.best_candidate)]);
  const Candidate& best = findings.candidates[static_cast<size_t>(findings.result.best_candidate)];
  findings.corrections = CorrectionsOf(run, best.prediction);
  findings.suspects = SuspectsOf(run, findings);
  findings.has_effect = ParametersWithEffect(run);
  return MakeDesignRecord(run, findings);
}

}  // namespace

SelectedDesign SelectDesign(RunSetup& run, std::vector<Design> designs, const CloneSource& clone) {
  SelectedDesign selected;
  selected.record =
      OnceAs<DesignRecord>(run.directory, SelectionArtifact(run), [&] { return Select(run, clone, designs); });
  for (const Design& design : designs) KeptTrials::Remove(run.directory.design_seed(design.setting, design.seed));
  const std::string& setting = selected.record.selected;
  if (std::ranges::find(designs, setting, &Design::setting) == designs.end()) {
    Append(designs, MakeDesigns(run, {{setting, run.Designs(setting)}}, clone));
  }
  for (const DesignRecord::Member& member : selected.record.mixture) {
    const auto of = std::ranges::find_if(
        designs, [&](const Design& design) { return design.setting == setting && design.seed == member.seed; });
    if (of == designs.end()) {
      throw DataError(
          fmt::format("'{}' has a design of seed {} in its mixture, which the settings '{}' did not make; restore it",
                      SelectionArtifact(run).file.string(), member.seed, setting));
    }
    selected.q.push_back(of->record.q);
  }
  return selected;
}

}  // namespace oted
