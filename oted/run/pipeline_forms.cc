// design.form = "auto": other forms are tried where the answer of the first is outside the family
// (oted/stages/design/form_choice.h).

#include <algorithm>
#include <nlohmann/json.hpp>

#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/matching/held_out.h"
#include "oted/run/pipeline.h"
#include "oted/stages/design/design.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

/// Curves of trials would stand among those of designs: their progress alone is told, as a stage of its own.
class TrialLog : public NullSink {
 public:
  explicit TrialLog(LogSink* log) : log_(log) {}
  void Progress(std::string_view, std::string_view label, int64_t done, int64_t total, std::string_view note) override {
    log_->Progress("forms", label, done, total, note);
  }

 private:
  LogSink* log_;
};

}  // namespace

std::vector<FormChoice> Pipeline::ChooseForms(const std::vector<Candidate>& candidates,
                                              const SelectionResult& result) const {
  std::vector<FormChoice> choices;
  for (const auto& [setting, design] : config_.DesignSettings()) {
    if (!design.by_auto) continue;
    const auto scored = std::ranges::find(result.settings, setting, &SettingScore::setting);
    const Candidate& best = candidates[static_cast<size_t>(scored->best_candidate)];
    FormChoice choice = !best.fit                               ? ChooseByCapability(design, factory_->spec())
                        : !AsksForOtherForms(best.q, *best.fit) ? KeepFirstForm(best.q, *best.fit)
                                                                : ChooseByTrial(setting, design, best);
    choice.setting = setting;
    choice.picked = choice.form == design.form ? setting : setting + "-" + choice.form;
    choices.push_back(std::move(choice));
  }
  return choices;
}

FormChoice Pipeline::ChooseByTrial(const std::string& setting, const DesignConfig& design,
                                   const Candidate& first) const {
  const fs::path folder = directory_.root() / "design" / setting / "forms";
  const std::string fingerprint = FormChoiceFingerprint(setting);
  if (directory_.IsComplete(folder / "choice.json", fingerprint)) {
    return FormChoiceFromJson(ReadJson(folder / "choice.json"));
  }
  const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("forms").Stage(setting);
  const HeldOutParts parts = HoldOut(dataset_, key.Stage("parts"));
  const auto replay = [&](const Dataset& logs, const std::vector<std::vector<double>>& z) {
    return ReplayHeldOut(*factory_, logs, z, *first.fit, context_.n_threads);
  };
  for (const Dataset* part : {&parts.learn, &parts.judge}) {
    if (replay(*part, {}).n_windows < kFewestWindows) return KeepFirstForm(first.q, *first.fit);
  }

  std::vector<std::string> forms = {design.form};
  forms.insert(forms.end(), OtherForms().begin(), OtherForms().end());
  const std::unique_ptr<const Policy> clone = LoadPolicy(directory_.clone() / "policy.npz");
  const auto file_of = [&](const std::string& form) { return folder / form / "q.json"; };
  std::vector<std::string> missing;
  for (const std::string& form : forms) {
    if (directory_.IsComplete(file_of(form), TrialFingerprint(setting, design.InForm(form)))) continue;
    missing.push_back(form);
  }
  TrialLog log(context_.log);
  RunContext share = context_.ShareOf(missing.size());
  share.log = &log;
  for (const std::string& form : missing) {
    log.Progress("", directory_.NameOf(folder / form), 0, design.InForm(form).n_iterations, "");
  }
  ParallelFor(static_cast<int>(missing.size()), context_.n_threads, [&](int i) {
    context_.ThrowIfStopped();
    const DesignConfig config = design.InForm(missing[static_cast<size_t>(i)]);
    const fs::path of_form = folder / config.form;
    const std::string trial = TrialFingerprint(setting, config);
    directory_.Begin(of_form, trial);
    const DesignResult result = LearnDesign(*factory_, parts.learn, clone.get(), config, key.Stage("trial"), of_form,
                                            directory_.NameOf(of_form), share);
    directory_.Complete(of_form / "q.json", result.q.ToJson(config.lambda), trial);
    directory_.RemoveCheckpoint(of_form);
  });

  std::vector<std::vector<double>> modes;
  for (const std::string& form : forms) {
    modes.push_back(Designer::FromJson(ReadJson(file_of(form)), factory_->parameters(), file_of(form).string()).Mode());
  }
  std::vector<std::vector<double>> compared = modes;
  compared.push_back(factory_->parameters().Nominal());
  FormChoice choice = ChooseByHeldOut(forms, modes, replay(parts.judge, compared));
  choice.setting = setting;
  json record = ToJson(choice);
  record["schema"] = "oted.form_choice/1";
  directory_.Complete(folder / "choice.json", record, fingerprint);
  return choice;
}

bool Pipeline::DesignInChosenForms(const std::vector<FormChoice>& choices, std::vector<Candidate>* candidates) {
  std::map<std::string, SettingDesigns> settings;
  for (const FormChoice& choice : choices) {
    if (choice.picked == choice.setting) continue;
    settings[choice.picked] = other_forms_.at(choice.picked);
    for (Candidate& candidate : *candidates) {
      if (candidate.setting == choice.setting) candidate.superseded = true;
    }
  }
  DesignAll(settings);
  for (const auto& [setting, designs] : settings) AddCandidates(setting, designs.config, candidates);
  return !settings.empty();
}

std::string Pipeline::TrialFingerprint(const std::string& setting, const DesignConfig& design) const {
  DesignConfig copy = design;
  return Fingerprint({"trial", DesignFingerprint(setting), copy.Fields().ToJson()});
}

std::string Pipeline::FormChoiceFingerprint(const std::string& setting) const {
  return Fingerprint({"form choice", DesignFingerprint(setting), config_.selection.n_seeds, OtherForms()});
}

}  // namespace oted
