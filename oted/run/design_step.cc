#include "oted/run/design_step.h"

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/run/artifacts.h"
#include "oted/run/growth_design.h"
#include "oted/stages/design/design.h"
#include "oted/stages/design/design_method.h"

namespace oted {

using nlohmann::json;

namespace {

namespace fs = std::filesystem;

/// A round's design with its curves, which are those of the design in `folder` as well.
json TakenFromRound(const RunSetup& run, int round, const fs::path& folder, const RunContext& context) {
  // As it is: a record that was read and written again may round otherwise.
  json design = JsonOfRound(run, round, context);
  const fs::path curves = run.directory.growth_design(round) / kCurves;
  if (fs::exists(curves)) WriteFileAtomically(folder / kCurves, ReadFile(curves));
  const int n = run.settings.begin()->second.config.n_iterations();
  context.log->Progress("design", run.directory.NameOf(folder), n, n, "");
  return design;
}

Design Make(const RunSetup& run, const std::string& setting, int seed, const Policy* clone, const RunContext& share) {
  const SettingDesigns& designs = run.Designs(setting);
  const fs::path folder = run.directory.design_seed(setting, seed);
  const Artifact artifact = DesignArtifact(run, setting, seed);
  Design design{.setting = setting, .seed = seed, .record = {}, .discriminator = {}, .clone = nullptr};
  const auto make = [&]() -> json {
    if (const std::optional<int> round = RoundOf(run, setting, seed)) return TakenFromRound(run, *round, folder, share);
    DesignResult result = LearnDesign(ProblemOf(run, setting, seed, clone, share), designs.config);
    if (result.g) {
      result.g->Save(design.discriminator);
      WriteNpz(design.discriminator, folder / "discriminator.npz");
    }
    if (result.clone) {
      result.clone->Save(folder / "policy.npz");
      design.clone = std::make_shared<TanhGaussianPolicy>(*std::move(result.clone));
    }
    return RecordOf(std::move(result), designs.config).ToJson();
  };
  design.record = QRecord::FromJson(run.directory.Once(artifact, make), run.parameters(), artifact.file.string());
  return design;
}

}  // namespace

QRecord RecordOf(DesignResult result, const DesignConfig& config) {
  return {std::move(result.q), config.adversarial.lambda, result.learning_progress, std::move(result.fit)};
}

DesignProblem ProblemOf(const RunSetup& run, const std::string& setting, int seed, const Policy* clone,
                        const RunContext& context) {
  const std::filesystem::path folder = run.directory.design_seed(setting, seed);
  return {.factory = *run.factory,
          .dataset = run.dataset,
          .clone = clone,
          .key = run.Key("design").Stage(run.Designs(setting).drawn_as).Index(static_cast<uint64_t>(seed)),
          .folder = folder,
          .run_name = run.directory.NameOf(folder),
          .context = context};
}

bool UsesClone(const RunSetup& run, const DesignConfig& config) {
  // Where states cannot be set, whatever needs no replays begins at a reset, and the clone goes on.
  return config.UsesClone() || (!run.spec().can_set_state && !Describe(config.method).needs.replays);
}

std::vector<Design> MakeDesigns(RunSetup& run, const std::map<std::string, SettingDesigns>& settings,
                                const CloneSource& clone) {
  std::vector<std::pair<std::string, int>> jobs;  // setting, seed
  size_t n_missing = 0;
  const bool acts = std::ranges::any_of(settings, [&](const auto& s) { return UsesClone(run, s.second.config); });
  const Policy* const cloned = acts ? clone() : nullptr;
  for (const auto& [setting, designs] : settings) {
    for (int seed = 1; seed <= run.NSeeds(setting); ++seed) {
      jobs.emplace_back(setting, seed);
      if (run.directory.IsComplete(DesignArtifact(run, setting, seed))) continue;
      if (n_missing++ == 0) ParametersWithEffect(run);
    }
  }
  // The bar knows all the work before any of it starts.
  for (const auto& [setting, seed] : jobs) {
    if (run.directory.IsComplete(DesignArtifact(run, setting, seed))) continue;
    const std::string name = run.directory.NameOf(run.directory.design_seed(setting, seed));
    run.context.log->Progress("design", name, 0, settings.at(setting).config.n_iterations(), "");
  }
  const RunContext share = run.context.ShareOf(n_missing);
  std::vector<Design> designs(jobs.size());
  ParallelFor(static_cast<int>(jobs.size()), run.context.n_threads, [&](int i) {
    run.context.ThrowIfStopped();
    const auto& [setting, seed] = jobs[static_cast<size_t>(i)];
    designs[static_cast<size_t>(i)] = Make(run, setting, seed, cloned, share);
  });
  return designs;
}

void Predict(const RunSetup& run, Candidate& candidate) {
  const auto make = [&] {
    if (const std::optional<int> round = RoundOf(run, candidate.setting, candidate.seed)) {
      return PredictionOfRound(run, *round, DesignOfRound(run, *round, run.context), run.context);
    }
    const DesignProblem problem = ProblemOf(run, candidate.setting, candidate.seed, nullptr, run.context);
    return PredictionRecord{PredictKeptAside(problem, candidate.q, candidate.fit)};
  };
  const Artifact artifact = PredictionArtifact(run, candidate.setting, candidate.seed);
  candidate.prediction = OnceAs<PredictionRecord>(run.directory, artifact, make).prediction;
}

Candidate AsCandidate(const RunSetup& run, const Design& design) {
  const DesignConfig& config = run.Designs(design.setting).config;
  const fs::path folder = run.directory.design_seed(design.setting, design.seed);
  Candidate candidate;
  candidate.setting = design.setting;
  candidate.method = Describe(config.method).name;
  candidate.seed = design.seed;
  candidate.q = design.record.q;
  candidate.learning_progress = design.record.learning_progress;
  if (Describe(config.method).is_algorithm1) {
    candidate.evidence = config.adversarial.Evidence(run.spec());
    Rng unused(0);
    candidate.g.emplace(DatasetFeatures(run.dataset, candidate.evidence), config.discriminator, unused,
                        FeatureShape(run.spec(), candidate.evidence));
    const fs::path file = folder / "discriminator.npz";
    candidate.g->Restore(design.discriminator.empty() ? ReadNpz(file) : design.discriminator, file.string());
  }
  candidate.clone = design.clone;
  if (candidate.clone == nullptr && config.adversarial.clone_updates > 0) {
    candidate.clone = LoadPolicy(folder / "policy.npz");
  }
  candidate.fit = design.record.fit;
  return candidate;
}

}  // namespace oted
