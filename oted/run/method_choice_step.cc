#include "oted/run/method_choice_step.h"

#include <algorithm>
#include <utility>

#include "oted/base/parallel.h"
#include "oted/matching/held_out.h"
#include "oted/run/artifacts.h"
#include "oted/run/records.h"
#include "oted/run/trial_log.h"
#include "oted/stages/design/design.h"
#include "oted/stages/design/design_method.h"

namespace oted {
namespace {

/// The first method and those that may take its place.
std::vector<DesignConfig> TriedDesigns(const RunSetup& run, const std::string& setting) {
  std::vector<DesignConfig> designs = {run.settings.at(setting).config};
  for (const DesignMethod method : OtherMethods()) {
    designs.push_back(run.other_methods.at(setting + "-" + Describe(method).name).config);
  }
  return designs;
}

/// The mode of every method's q, learned from part of the logs.
std::vector<std::vector<double>> TrialModes(const RunSetup& run, const std::string& setting,
                                            const std::vector<DesignConfig>& designs, const Dataset& learn,
                                            const CloneSource& clone) {
  const bool acts = std::ranges::any_of(designs, [&](const DesignConfig& of) { return UsesClone(run, of); });
  const Policy* const cloned = acts ? clone() : nullptr;
  TrialLog log(run.context.log, "methods", TrialLog::Stages::kOne);
  size_t n_missing = 0;
  for (const DesignConfig& design : designs) {
    const Artifact artifact = TrialArtifact(run, setting, design);
    if (run.directory.IsComplete(artifact)) continue;
    ++n_missing;
    log.Progress("", run.directory.NameOf(artifact.file.parent_path()), 0, design.n_iterations(), "");
  }
  RunContext share = run.context.ShareOf(n_missing);
  share.log = &log;
  std::vector<std::vector<double>> modes(designs.size());
  ParallelFor(static_cast<int>(designs.size()), run.context.n_threads, [&](int i) {
    run.context.ThrowIfStopped();
    const DesignConfig& config = designs[static_cast<size_t>(i)];
    const Artifact artifact = TrialArtifact(run, setting, config);
    const auto make = [&] {
      const std::filesystem::path folder = artifact.file.parent_path();
      DesignResult result = LearnDesign({.factory = *run.factory,
                                         .dataset = learn,
                                         .clone = cloned,
                                         .key = run.Key("forms").Stage(setting).Stage("trial"),
                                         .folder = folder,
                                         .run_name = run.directory.NameOf(folder),
                                         .context = share,
                                         .judged = false},
                                        config);
      return QRecord{std::move(result.q), config.adversarial.lambda, {}, {}};
    };
    modes[static_cast<size_t>(i)] = OnceAs<QRecord>(run.directory, artifact, make, run.parameters()).q.Mode();
  });
  return modes;
}

/// By designs from part of the logs, judged on the rest. @param first  the best design by the first method
MethodChoice ChooseByTrial(const RunSetup& run, const std::string& setting, const Candidate& first,
                           const CloneSource& clone) {
  const HeldOutParts parts = HoldOut(run.dataset, run.Key("forms").Stage(setting).Stage("parts"));
  const auto replay = [&](const Dataset& logs, const std::vector<std::vector<double>>& z) {
    return ReplayHeldOut(*run.factory, logs, z, *first.fit, run.context.n_threads);
  };
  const Artifact artifact = MethodChoiceArtifact(run, setting);
  if (!run.directory.IsComplete(artifact)) {
    for (const Dataset* part : {&parts.learn, &parts.judge}) {
      if (replay(*part, {}).n_windows < kFewestWindows) return KeepFirstMethod(first.prediction);
    }
  }
  const auto make = [&] {
    const std::vector<DesignConfig> designs = TriedDesigns(run, setting);
    const std::vector<std::vector<double>> modes = TrialModes(run, setting, designs, parts.learn, clone);
    std::vector<std::vector<double>> compared = modes;
    compared.push_back(run.parameters().Nominal());
    std::vector<DesignMethod> methods;
    for (const DesignConfig& design : designs) methods.push_back(design.method);
    MethodChoiceRecord record{ChooseByHeldOut(methods, modes, replay(parts.judge, compared))};
    record.choice.setting = setting;
    return record;
  };
  return OnceAs<MethodChoiceRecord>(run.directory, artifact, make).choice;
}

}  // namespace

std::vector<MethodChoice> ChooseMethods(const RunSetup& run, const std::vector<Candidate>& candidates,
                                        const SelectionResult& result, const CloneSource& clone) {
  std::vector<MethodChoice> choices;
  for (const auto& [setting, asked] : run.config.DesignSettings()) {
    if (asked.method) continue;
    const DesignMethod first = run.settings.at(setting).config.method;
    const auto scored = std::ranges::find(result.settings, setting, &SettingScore::setting);
    const Candidate& best = candidates[static_cast<size_t>(scored->best_candidate)];
    const bool first_alone = !best.fit || !run.spec().can_set_state;
    MethodChoice choice = first_alone                             ? ChooseByCapability(first, run.spec())
                          : !AsksForOtherMethods(best.prediction) ? KeepFirstMethod(best.prediction)
                                                                  : ChooseByTrial(run, setting, best, clone);
    choice.setting = setting;
    choice.picked = choice.method == first ? setting : setting + "-" + Describe(choice.method).name;
    choices.push_back(std::move(choice));
  }
  return choices;
}

}  // namespace oted
