#include "oted/run/run_setup.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string>
#include <utility>
#include <vector>

#include "oted/base/error.h"
#include "oted/run/artifacts.h"
#include "oted/run/growth_step.h"
#include "oted/run/provenance.h"
#include "oted/run/replay_step.h"
#include "oted/run/run_inputs.h"
#include "oted/stages/design/design_method.h"
#include "oted/stages/design/effects.h"
#include "oted/stages/design/method_choice.h"
#include "oted/stages/design/prior_source.h"

namespace oted {
namespace {

constexpr int kEffectEpisodes = 3;

RunConfig ExpandAndCheck(RunConfig config, const RunContext& context) {
  config.task.Resolve();
  std::vector<std::string> notes;
  RunConfig expanded = ExpandPresets(std::move(config), &notes);
  expanded.Check();
  for (const std::string& note : notes) context.log->Warning("left out: " + note);
  return expanded;
}

/// Of a setting whose method was left to auto: the methods that may take the first one's place.
void AddOtherMethods(RunSetup& run, const std::string& setting, const DesignChoice& choice) {
  for (const DesignMethod method : OtherMethods()) {
    const std::string& name = Describe(method).name;
    const std::string other = fmt::format("{}-{}", setting, name);
    if (run.config.settings.contains(other)) {
      throw UsageError(
          fmt::format("design.settings.{} has the name that '{}' takes when auto picks the method {}; choose another",
                      other, setting, name));
    }
    run.other_methods.emplace(other, SettingDesigns{choice.Resolved(method, run.spec()), setting});
  }
}

/// Settles the method of every setting, and its settings, for this simulator.
void ResolveDesigns(RunSetup& run) {
  const SimulatorSpec& spec = run.spec();
  bool adapted = false;
  for (const auto& [name, choice] : run.config.DesignSettings()) {
    const DesignConfig design = choice.Resolved(run.parameters(), spec);
    // Of images auto has a method of its own: nothing was given up.
    adapted = adapted || (!spec.can_replay() && design.method != DesignMethod::kImages &&
                          (!choice.method || choice.Assumed().adversarial.starts == RolloutStarts::kDataset));
    run.settings.emplace(name, SettingDesigns{design, name});
    if (!choice.method && design.method == DesignMethod::kTrajectories && spec.can_set_state) {
      AddOtherMethods(run, name, choice);
    }
  }
  if (!adapted) return;
  const std::string why_not = run.factory->why_not_settable();
  run.context.log->Warning(fmt::format(
      "task '{}' cannot be set to a logged state{}: rollouts begin at the task's own starts and the clone acts "
      "(design.adversarial.starts = initial, actions = clone, horizon = {})",
      run.config.task.name, why_not.empty() ? "" : fmt::format(" ({})", why_not),
      run.settings.begin()->second.config.adversarial.horizon));
}

/// Parameters are those of the run: all of its settings have them.
void CheckGrowth(const RunSetup& run) {
  for (const auto& [name, designs] : run.settings) {
    const DesignConfig& config = designs.config;
    if (config.grow != run.grows()) {
      throw UsageError(fmt::format(
          "design.settings.{}.grow differs from other settings', and parameters are those of the whole run; set "
          "design.grow alone",
          name));
    }
    if (!config.grow) continue;
    if (config.method != DesignMethod::kTrajectories) {
      throw UsageError(
          fmt::format("design.grow frees suspects, which method trajectories alone finds, and the method here is {}; "
                      "drop --grow, or choose that method",
                      Describe(config.method).name));
    }
    if (PriorSourceOf(config.prior) == PriorSource::kDesign) {
      throw UsageError(fmt::format(
          "design.prior = \"{}\" knows nothing of parameters that design.grow adds; set it to uniform or gaussian, or "
          "drop --grow",
          config.prior));
    }
  }
}

void CheckRequest(RunSetup& run) {
  const RunConfig& config = run.config;
  const ParameterSpace& parameters = run.parameters();
  run.dataset.CheckFits(config.task.name, run.spec().obs_dim(), run.spec().act_dim);
  if (!config.truth.empty()) parameters.CheckInside(config.TruthVector());
  if (!config.agents.nominal_at.empty()) parameters.CheckInside(config.agents.nominal_at);
  config.CheckAgentSettings(run.spec());
  if (config.baselines.Runs(Baseline::kIntervalSearch)) CheckIntervalSearch(config.baselines.is, run.spec());
  for (const OfflineBaseline baseline : config.baselines.Offline()) {
    CheckOffline(EntryOf(baseline), config.baselines.offline, run.dataset, run.spec());
  }
  config.clone.MethodFor(run.spec());
  for (const auto& [name, designs] : run.settings) {
    FeatureShape(run.spec(), designs.config.adversarial.Evidence(run.spec()));
    designs.config.MakePrior(parameters);
    designs.config.Check();  // once more, as the method that auto became
    const MethodDescription& method = Describe(designs.config.method);
    CheckSelectionScore(config.selection.score, name, method.name, method.is_algorithm1);
  }
  CheckGrowth(run);
  CheckCanDraw(config, *run.factory);
  if (config.run.strict) ParametersWithEffect(run);
}

}  // namespace

int RunSetup::NSeeds(const std::string& setting) const {
  if (config.selection.n_seeds > 0) return config.selection.n_seeds;
  // What deviates needs something to deviate from.
  if (config.selection.score == SelectionScore::kDesignDeviation) return MethodDescription{}.n_seeds;
  return Describe(Designs(setting).config.method).n_seeds;
}

std::vector<Ground> RunSetup::Grounds() const {
  std::vector<Ground> grounds = {Ground::kDesigned};
  if (config.agents.nominal && !config.truth.empty()) grounds.push_back(Ground::kNominal);
  for (const Baseline baseline : config.baselines.Agents()) {
    grounds.push_back(baseline == Baseline::kIntervalSearch ? Ground::kIntervalSearch : Ground::kDomainRandomization);
  }
  return grounds;
}

std::filesystem::path RunSetup::AgentFolder(Ground ground, int index) const {
  if (ground == Ground::kDesigned) return directory.agent(index);
  if (ground == Ground::kNominal) return directory.nominal(index);
  return directory.baseline(NameOf(GroundNames(), ground), index);
}

ActionNoise RunSetup::JudgedNoise() const { return config.Algorithm(spec()).noise(config.algorithms); }

namespace {

/// Whether what lies in the run directory is of these settings. @throws UsageError naming those that are not
void CheckDirectory(const RunSetup& run) {
  constexpr size_t kMostNamed = 4;
  try {
    run.directory.Check(AllArtifacts(run));
  } catch (const UsageError& refused) {
    std::vector<std::string> changed = ChangedSettings(run);
    // By the parameters of a growth that was stopped, or that damage took away, nothing fits yet.
    const bool is_to_grow = !IsGrown(run) && std::filesystem::exists(run.directory.growth(1));
    if (changed.empty() && is_to_grow) return;
    if (changed.empty()) throw;
    if (changed.size() > kMostNamed) {
      changed.resize(kMostNamed);
      changed.emplace_back("...");
    }
    throw UsageError(fmt::format("{}; different from its run.toml: {}", refused.what(), fmt::join(changed, ", ")));
  }
}

}  // namespace

RunSetup SetUpRun(RunConfig given, const std::filesystem::path& out, RunContext context) {
  RunConfig config = ExpandAndCheck(std::move(given), context);
  context.n_threads = config.Threads();
  Dataset dataset = ReadEpisodes(config.data, SpecOf(config.task));
  auto factory = MakeSimulatorFactory(config.task, config.parameters, dataset.EpisodeStarts());
  const std::string sha256 = factory->model_sha256();
  RunSetup run{std::move(config), context, std::move(dataset), std::move(factory), sha256, {}, {}, RunDirectory()};
  ResolveDesigns(run);
  CheckRequest(run);
  run.directory = RunDirectory(out, run.context.log);
  TakeFinishedGrowth(run);
  CheckDirectory(run);
  if (const auto unread = run.config.UnreadSetting()) context.log->Warning(*unread);
  if (const auto told = run.config.data.ChosenEpisodes().Renumbering(); !told.empty()) context.log->Warning(told);
  return run;
}

const std::vector<bool>& ParametersWithEffect(RunSetup& run) {
  if (!run.has_effect.empty()) return run.has_effect;
  run.has_effect = HaveEffects(*run.factory, run.dataset, kEffectEpisodes, run.Key("effects"), run.context.n_threads);
  for (size_t i = 0; i < run.has_effect.size(); ++i) {
    if (run.has_effect[i]) continue;
    const ParameterSpec& spec = run.config.parameters[i];
    const std::string message = fmt::format(
        "parameter '{}' ({}) changes nothing that the logged episodes show, from {} to {}: it will be reported as not "
        "identified; check the path, or remove the parameter",
        spec.name, spec.field, spec.low, spec.high);
    if (run.config.run.strict) throw UsageError(message + " (run.strict)");
    run.context.log->Warning(message);
  }
  return run.has_effect;
}

}  // namespace oted
