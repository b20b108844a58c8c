// design.method = "auto": other methods are tried where the answer of the first is outside the family
// (oted/stages/design/method_choice.h).

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
    log_->Progress("methods", label, done, total, note);
  }

 private:
  LogSink* log_;
};

}  // namespace

std::vector<MethodChoice> Pipeline::ChooseMethods(const std::vector<Candidate>& candidates,
                                                  const SelectionResult& result) const {
  std::vector<MethodChoice> choices;
  for (const auto& [setting, asked] : config_.DesignSettings()) {
    if (asked.method) continue;
    const DesignConfig& design = designs_.at(setting);
    const auto scored = std::ranges::find(result.settings, setting, &SettingScore::setting);
    const Candidate& best = candidates[static_cast<size_t>(scored->best_candidate)];
    MethodChoice choice = !best.fit ? ChooseByCapability(design.method, factory_->spec())
                          : !AsksForOtherMethods(best.q, *best.fit) ? KeepFirstMethod(best.q, *best.fit)
                                                                    : ChooseByTrial(setting, best);
    choice.setting = setting;
    choice.picked = choice.method == design.method ? setting : setting + "-" + Describe(choice.method).name;
    choices.push_back(std::move(choice));
  }
  return choices;
}

MethodChoice Pipeline::ChooseByTrial(const std::string& setting, const Candidate& first) const {
  const fs::path folder = directory_.root() / "design" / setting / "methods";
  const std::string fingerprint = MethodChoiceFingerprint(setting);
  if (directory_.IsComplete(folder / "choice.json", fingerprint)) {
    return MethodChoiceFromJson(ReadJson(folder / "choice.json"));
  }
  const RngKey key = RngKey(static_cast<uint64_t>(config_.run.seed)).Stage("forms").Stage(setting);
  const HeldOutParts parts = HoldOut(dataset_, key.Stage("parts"));
  const auto replay = [&](const Dataset& logs, const std::vector<std::vector<double>>& z) {
    return ReplayHeldOut(*factory_, logs, z, *first.fit, context_.n_threads);
  };
  for (const Dataset* part : {&parts.learn, &parts.judge}) {
    if (replay(*part, {}).n_windows < kFewestWindows) return KeepFirstMethod(first.q, *first.fit);
  }

  std::vector<DesignConfig> designs = {designs_.at(setting)};
  for (const DesignMethod method : OtherMethods()) {
    designs.push_back(other_methods_.at(setting + "-" + Describe(method).name).config);
  }
  const std::unique_ptr<const Policy> clone = LoadPolicy(directory_.clone() / "policy.npz");
  const auto folder_of = [&](const DesignConfig& design) { return folder / Describe(design.method).name; };
  std::vector<DesignConfig> missing;
  for (const DesignConfig& design : designs) {
    if (directory_.IsComplete(folder_of(design) / "q.json", TrialFingerprint(setting, design))) continue;
    missing.push_back(design);
  }
  TrialLog log(context_.log);
  RunContext share = context_.ShareOf(missing.size());
  share.log = &log;
  for (const DesignConfig& design : missing) {
    log.Progress("", directory_.NameOf(folder_of(design)), 0, design.n_iterations(), "");
  }
  ParallelFor(static_cast<int>(missing.size()), context_.n_threads, [&](int i) {
    context_.ThrowIfStopped();
    const DesignConfig& config = missing[static_cast<size_t>(i)];
    const fs::path of_method = folder_of(config);
    const std::string trial = TrialFingerprint(setting, config);
    directory_.Begin(of_method, trial);
    const DesignResult result = LearnDesign({.factory = *factory_,
                                             .dataset = parts.learn,
                                             .clone = clone.get(),
                                             .key = key.Stage("trial"),
                                             .folder = of_method,
                                             .run_name = directory_.NameOf(of_method),
                                             .context = share},
                                            config);
    directory_.Complete(of_method / "q.json", result.q.ToJson(config.adversarial.lambda), trial);
    directory_.RemoveCheckpoint(of_method);
  });

  std::vector<DesignMethod> methods;
  std::vector<std::vector<double>> modes;
  for (const DesignConfig& design : designs) {
    const fs::path file = folder_of(design) / "q.json";
    methods.push_back(design.method);
    modes.push_back(Designer::FromJson(ReadJson(file), factory_->parameters(), file.string()).Mode());
  }
  std::vector<std::vector<double>> compared = modes;
  compared.push_back(factory_->parameters().Nominal());
  MethodChoice choice = ChooseByHeldOut(methods, modes, replay(parts.judge, compared));
  choice.setting = setting;
  json record = ToJson(choice);
  record["schema"] = "oted.method_choice/1";
  directory_.Complete(folder / "choice.json", record, fingerprint);
  return choice;
}

bool Pipeline::DesignInChosenMethods(const std::vector<MethodChoice>& choices, std::vector<Candidate>* candidates) {
  std::map<std::string, SettingDesigns> settings;
  for (const MethodChoice& choice : choices) {
    if (choice.picked == choice.setting) continue;
    settings[choice.picked] = other_methods_.at(choice.picked);
    for (Candidate& candidate : *candidates) {
      if (candidate.setting == choice.setting) candidate.superseded = true;
    }
  }
  DesignAll(settings);
  for (const auto& [setting, designs] : settings) AddCandidates(setting, designs.config, candidates);
  return !settings.empty();
}

std::string Pipeline::TrialFingerprint(const std::string& setting, const DesignConfig& design) const {
  return Fingerprint({"trial", DesignFingerprint(setting), design.ToJson()});
}

std::string Pipeline::MethodChoiceFingerprint(const std::string& setting) const {
  json others = json::array();
  for (const DesignMethod method : OtherMethods()) others.push_back(Describe(method).name);
  return Fingerprint({"method choice", DesignFingerprint(setting), config_.selection.n_seeds, others});
}

}  // namespace oted
