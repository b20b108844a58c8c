#include "oted/run/agents_step.h"

#include <fmt/format.h>

#include <utility>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/baselines/bc_dr.h"
#include "oted/nn/onnx_export.h"
#include "oted/rl/batch_policy.h"
#include "oted/run/artifacts.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

/// What a policy's ONNX file names as its origin: the folder's name and what it was made from.
std::string SourceOf(const RunSetup& run, const Artifact& artifact) {
  return fmt::format("{} {}", run.directory.NameOf(artifact.file.parent_path()), artifact.fingerprint);
}

/// A policy that was just made, as policy.npz beside its artefact shows it: its policy.onnx is written, whatever was
/// there.
void Export(const RunSetup& run, const Artifact& artifact, StoredPolicy& stored) {
  stored.source = SourceOf(run, artifact);
  if (stored.policy->has_onnx()) ExportPolicy(run, stored, artifact.file.parent_path() / "policy.onnx");
}

/// The policy beside an artefact; policy.onnx is made again where it is missing.
void Recall(const RunSetup& run, const Artifact& artifact, StoredPolicy& stored) {
  const fs::path folder = artifact.file.parent_path();
  if (stored.policy == nullptr) stored.policy = LoadPolicy(folder / "policy.npz");
  stored.source = SourceOf(run, artifact);
  if (!fs::exists(folder / "policy.onnx")) Export(run, artifact, stored);
}

TrainingGround GroundOf(const RunSetup& run, Ground ground, const SelectedDesign& design) {
  if (ground != Ground::kDesigned) return ComparedGround(ground, run.config, *run.factory);
  return DesignedGround(run.config.agents.train_in, {design.record.MixtureModes(), design.record.BestMode(), design.q});
}

TrainedRecord MakeAgent(const RunSetup& run, Ground ground, int index, const SelectedDesign& design,
                        const RunContext& share) {
  const Artifact artifact = AgentArtifact(run, ground, index);
  const fs::path folder = artifact.file.parent_path();
  TrainedRecord agent;
  agent.record = OnceAs<AgentRecord>(run.directory, artifact, [&] {
    const AgentTraining training{*run.factory, run.config, ground, index, folder, run.directory.NameOf(folder), share};
    TrainedRecord trained = TrainOneAgent(training, GroundOf(run, ground, design));
    agent.policy = trained.policy;
    Export(run, artifact, agent);
    return trained.record;
  });
  Recall(run, artifact, agent);
  return agent;
}

/// The clone of the logs and of data collected under domain randomisation.
StoredPolicy MakeBcDr(const RunSetup& run, const Agents& agents, const Policy& clone) {
  const Artifact artifact = BcDrArtifact(run);
  const fs::path folder = artifact.file.parent_path();
  const BcDrConfig& settings = run.config.baselines.bc_dr;
  StoredPolicy stored;
  run.directory.Once(artifact, [&] {
    const Policy& collector =
        settings.collector == Collector::kRandomizedAgent ? *agents.Best(Ground::kDomainRandomization).policy : clone;
    const CloneJob job{
        run.dataset, run.spec(), run.config.clone, BaselineKey(run.config, "bc_dr"), run.directory.NameOf(folder),
        run.context};
    CloneResult result = CloneWithSimulated(job, *run.factory, collector, settings.ratio);
    result.policy->Save(folder / "policy.npz");
    stored.policy = std::move(result.policy);
    Export(run, artifact, stored);
    return CloneRecord::Of(result).ToJson();
  });
  Recall(run, artifact, stored);
  return stored;
}

StoredPolicy MakeOffline(const RunSetup& run, OfflineBaseline baseline, const RunContext& share) {
  const Artifact artifact = OfflineArtifact(run, baseline);
  const fs::path folder = artifact.file.parent_path();
  StoredPolicy stored;
  OnceAs<OfflineRecord>(run.directory, artifact, [&] {
    LearnedRecord learned =
        LearnOneBaseline({run.config, run.dataset, run.spec(), baseline, folder, run.directory.NameOf(folder), share});
    stored.policy = learned.policy;
    Export(run, artifact, stored);
    return learned.record;
  });
  Recall(run, artifact, stored);
  return stored;
}

}  // namespace

const TrainedRecord& Agents::Best(Ground ground) const {
  const std::vector<TrainedRecord>& agents = of.at(ground);
  const auto evaluated = [](const TrainedRecord& agent) {
    return EvaluatedReturn{agent.record.eval_return, agent.record.always_diverged};
  };
  size_t best = 0;
  for (size_t j = 1; j < agents.size(); ++j) {
    if (evaluated(agents[j]).IsBetterThan(evaluated(agents[best]))) best = j;
  }
  return agents[best];
}

TrainedRecord TrainOneAgent(const AgentTraining& training, TrainingGround where) {
  const RunConfig& config = training.config;
  const AlgorithmEntry& algorithm = config.Algorithm(training.factory.spec());
  TrainedAgent agent = algorithm.train(
      {.factory = training.factory,
       .source = *where.episodes,
       .eval_parameters = where.evaluate_in,
       .key =
           RngKey(static_cast<uint64_t>(config.run.seed)).Stage("agent").Index(static_cast<uint64_t>(training.index)),
       .folder = training.folder,
       .run_name = training.run_name,
       .context = training.context},
      config.algorithms, config.agents.device);
  agent.policy->Save(training.folder / "policy.npz");
  TrainedRecord trained;
  trained.policy = std::move(agent.policy);
  trained.record = {.agent = training.index,
                    .ground = training.ground,
                    .algorithm = algorithm.algorithm,
                    .train_in = config.agents.train_in,
                    .seed = config.run.seed,
                    .n_steps = algorithm.n_steps(config.algorithms),
                    .eval_return = agent.curve.eval_return,
                    .always_diverged = agent.curve.always_diverged,
                    .episodes = where.episodes->Figures()};
  return trained;
}

LearnedRecord LearnOneBaseline(const OfflineTraining& training) {
  const OfflineEntry& entry = EntryOf(training.baseline);
  const OfflineJob job{training.dataset, training.spec,     BaselineKey(training.config, entry.name),
                       training.folder,  training.run_name, training.context};
  const std::unique_ptr<OfflineLearner> learner = entry.make(job, training.config.baselines.offline);
  OfflineResult result = LearnOffline(*learner, job);
  result.policy->Save(training.folder / "policy.npz");
  LearnedRecord learned;
  learned.policy = std::move(result.policy);
  learned.record = {entry.name, training.config.run.seed, learner->total(), training.dataset.size(),
                    std::move(result.losses)};
  return learned;
}

void CheckHasReward(const SimulatorSpec& spec) {
  if (spec.has_reward) return;
  throw UsageError(fmt::format("task '{}' has no reward to train agents with; add task.reward = \"...\"", spec.task));
}

Agents TrainAgents(const RunSetup& run, const SelectedDesign& design, const Policy& clone) {
  CheckHasReward(run.spec());
  std::vector<std::pair<Ground, int>> jobs;
  for (int j = 1; j <= run.config.agents.n_agents; ++j) {
    for (const Ground ground : run.Grounds()) jobs.emplace_back(ground, j);
  }
  const int64_t n_steps = run.config.Algorithm(run.spec()).n_steps(run.config.algorithms);
  size_t n_missing = 0;
  for (const auto& [ground, j] : jobs) {
    if (run.directory.IsComplete(AgentArtifact(run, ground, j))) continue;
    ++n_missing;
    run.context.log->Progress("train", run.directory.NameOf(run.AgentFolder(ground, j)), 0, n_steps, "");
  }
  const RunContext share = run.context.ShareOf(n_missing);
  std::vector<TrainedRecord> trained(jobs.size());
  ParallelFor(static_cast<int>(jobs.size()), run.context.n_threads, [&](int i) {
    run.context.ThrowIfStopped();
    const auto& [ground, j] = jobs[static_cast<size_t>(i)];
    trained[static_cast<size_t>(i)] = MakeAgent(run, ground, j, design, share);
  });
  Agents agents;
  for (size_t i = 0; i < jobs.size(); ++i) agents.of[jobs[i].first].push_back(std::move(trained[i]));
  if (run.config.baselines.Runs(Baseline::kBcDr)) agents.bc_dr = MakeBcDr(run, agents, clone);
  const std::vector<OfflineBaseline> offline = run.config.baselines.Offline();
  agents.offline.resize(offline.size());
  ParallelFor(static_cast<int>(offline.size()), run.context.n_threads, [&](int i) {
    run.context.ThrowIfStopped();
    const auto k = static_cast<size_t>(i);
    agents.offline[k] = {offline[k], MakeOffline(run, offline[k], run.context.ShareOf(offline.size()))};
  });
  return agents;
}

void ExportPolicy(const RunSetup& run, const StoredPolicy& policy, const fs::path& path) {
  WriteOnnx(*policy.policy, PolicyMetadata(run.spec(), policy.source), path);
}

}  // namespace oted
