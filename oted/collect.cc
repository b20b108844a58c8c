#include "oted/collect.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/sim/rollout.h"

namespace oted {
namespace {

constexpr int kJudgeEpisodes = 20;

double RandomReturn(const SimulatorFactory& factory, RngKey key, int n_threads) {
  const auto simulator = factory.Make(kJudgeEpisodes, n_threads);
  Rng rng = key.Stage("actions").MakeRng();
  const std::vector<std::vector<double>> z(kJudgeEpisodes, factory.parameters().Nominal());
  return MeanReturn(RunEpisodes(*simulator, z, UniformRandomPolicy(factory.spec(), rng), key));
}

double RoundToFloat(double value) { return static_cast<double>(static_cast<float>(value)); }

std::vector<double> RoundToFloat(std::span<const double> values) {
  std::vector<double> rounded;
  for (const double value : values) rounded.push_back(RoundToFloat(value));
  return rounded;
}

/// D4RL's files hold float32: what is logged is what is there.
void LogStep(const StepView& step, bool has_reward, Dataset& log) {
  if (step.status == LaneStatus::kDiverged) {
    throw DataError(
        "the target diverged while demonstrations were logged; choose target parameters nearer to nominal, or a "
        "gentler "
        "policy");
  }
  log.observations.AppendRow(RoundToFloat(step.observation));
  log.actions.AppendRow(step.action);
  log.next_observations.AppendRow(RoundToFloat(step.next_observation));
  if (has_reward) log.rewards.push_back(RoundToFloat(step.reward));
  log.terminals.push_back(step.status == LaneStatus::kTerminated);
  log.timeouts.push_back(step.status == LaneStatus::kTruncated);
}

}  // namespace

BehaviorPolicies TrainBehaviorPolicies(const SimulatorFactory& factory, const SacConfig& config, uint64_t seed,
                                       const std::filesystem::path& folder, const RunContext& context) {
  const RngKey key = RngKey(seed).Stage("behavior policies");
  const std::vector<double> nominal = factory.parameters().Nominal();
  const auto snapshot = [&](int64_t step) { return folder / "snapshots" / (std::to_string(step) + ".npz"); };
  const SacResult training = TrainSac(
      factory, [&](Rng&) { return nominal; }, {nominal}, config, key, folder, "behavior", context,
      [&](int64_t step, const TanhGaussianPolicy& policy, double) { policy.Save(snapshot(step)); });

  const auto& returns = training.eval_returns;
  const size_t best = static_cast<size_t>(std::max_element(returns.begin(), returns.end()) - returns.begin());

  BehaviorPolicies result;
  const auto judge = [&](const TanhGaussianPolicy& policy) {
    return EvaluatePolicy(factory, policy, {nominal}, kJudgeEpisodes, context.n_threads, key.Stage("judge"));
  };
  result.expert_step = training.eval_steps[best];
  result.expert = TanhGaussianPolicy::Load(snapshot(result.expert_step));
  result.expert_return = judge(result.expert);
  // The medium policy comes on the way up. The learning curve's few episodes would misjudge it: every snapshot until
  // the expert's gets as many as the expert.
  for (size_t i = 0; i <= best; ++i) {
    TanhGaussianPolicy policy = TanhGaussianPolicy::Load(snapshot(training.eval_steps[i]));
    const double mean_return = judge(policy);
    const double third = result.expert_return / 3;
    if (i > 0 && std::abs(mean_return - third) >= std::abs(result.medium_return - third)) continue;
    result.medium_step = training.eval_steps[i];
    result.medium = std::move(policy);
    result.medium_return = mean_return;
  }
  result.random_return = RandomReturn(factory, key.Stage("random"), context.n_threads);

  const SimulatorSpec& spec = factory.spec();
  const auto describe = [&](int64_t step, double mean_return) {
    nlohmann::json entry = {{"step", step}, {"mean_return", mean_return}};
    if (spec.has_score()) entry["score"] = spec.NormalizedScore(mean_return);
    return entry;
  };
  nlohmann::json record = {{"task", spec.task},
                           {"seed", seed},
                           {"episodes", kJudgeEpisodes},
                           {"expert", describe(result.expert_step, result.expert_return)},
                           {"medium", describe(result.medium_step, result.medium_return)},
                           {"random", describe(0, result.random_return)},
                           {"learning_curve", {{"step", training.eval_steps}, {"mean_return", returns}}}};
  SacConfig settings = config;
  record["sac"] = settings.Fields("sac").ToJson();
  result.expert.Save(folder / "expert.npz");
  result.medium.Save(folder / "medium.npz");
  WriteJson(folder / "training.json", record);
  return result;
}

Dataset CollectExcitation(const SimulatorFactory& factory, const std::vector<double>& z, const Excitation& excitation,
                          int n_episodes, RngKey key, int n_threads) {
  std::vector<Dataset> episodes(static_cast<size_t>(n_episodes));
  ParallelFor(n_episodes, n_threads, [&](int i) {
    const auto simulator = factory.Make(1, 1);
    const RngKey episode = key.Index(static_cast<uint64_t>(i));
    OpenLoop actions(excitation, factory.spec(), episode.Stage("actions"));
    const auto act = [&](std::span<const double>, int, std::span<double> out) {
      actions.Next(out);
      for (double& a : out) a = RoundToFloat(a);
    };
    RunEpisodes(*simulator, {z}, act, episode.Stage("episodes"), [&](const StepView& step) {
      LogStep(step, factory.spec().has_reward, episodes[static_cast<size_t>(i)]);
    });
  });
  Dataset dataset;
  for (const Dataset& episode : episodes) dataset.Append(episode);
  return dataset;
}

Dataset CollectDemonstrations(const SimulatorFactory& factory, const std::vector<double>& z,
                              const TanhGaussianPolicy& policy, int n_episodes, RngKey key, int n_threads) {
  const auto simulator = factory.Make(n_episodes, n_threads);
  PolicyRunner runner(policy, ActionNoise::kSampled);
  Rng noise = key.Stage("actions").MakeRng();
  const auto act = [&](std::span<const double> observations, int n, std::span<double> actions) {
    runner.Act(observations, n, noise, actions);
    // D4RL's files hold float32: what is logged is what was done.
    for (double& a : actions) a = RoundToFloat(a);
  };
  std::vector<Dataset> lanes(static_cast<size_t>(n_episodes));
  const bool has_reward = factory.spec().has_reward;
  const auto record = [&](const StepView& step) { LogStep(step, has_reward, lanes[static_cast<size_t>(step.lane)]); };
  RunEpisodes(*simulator, std::vector<std::vector<double>>(static_cast<size_t>(n_episodes), z), act,
              key.Stage("episodes"), record);
  Dataset dataset;
  for (const Dataset& lane : lanes) dataset.Append(lane);
  return dataset;
}

}  // namespace oted
