#include "oted/collect.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/rl/batch_policy.h"
#include "oted/sim/episode_recorder.h"

namespace oted {
namespace {

constexpr int kJudgeEpisodes = 20;

double RandomReturn(const SimulatorFactory& factory, RngKey key, int n_threads) {
  const auto simulator = factory.Make(kJudgeEpisodes, n_threads);
  Rng rng = key.Stage("actions").MakeRng();
  const std::vector<std::vector<double>> z(kJudgeEpisodes, factory.parameters().Nominal());
  return MeanReturn(RunEpisodes(*simulator, z, UniformRandomPolicy(factory.spec(), rng), key));
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
  // The medium policy comes on the way up: evaluations after the expert's are not looked at.
  size_t middle = 0;
  for (size_t i = 0; i <= best; ++i) {
    if (std::abs(returns[i] - returns[best] / 3) < std::abs(returns[middle] - returns[best] / 3)) middle = i;
  }

  BehaviorPolicies result;
  const auto judge = [&](const TanhGaussianPolicy& policy) {
    return EvaluatePolicy(factory, policy, {nominal}, kJudgeEpisodes, context.n_threads, key.Stage("judge"));
  };
  result.expert_step = training.eval_steps[best];
  result.medium_step = training.eval_steps[middle];
  result.expert = TanhGaussianPolicy::Load(snapshot(result.expert_step));
  result.medium = TanhGaussianPolicy::Load(snapshot(result.medium_step));
  result.expert_return = judge(result.expert);
  result.medium_return = judge(result.medium);
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

Dataset CollectDemonstrations(const SimulatorFactory& factory, const std::vector<double>& z,
                              const TanhGaussianPolicy& policy, int n_episodes, RngKey key, int n_threads) {
  const auto simulator = factory.Make(n_episodes, n_threads);
  const BatchPolicy sampled = AsBatchPolicy(policy, ActionNoise::kSampled, key.Stage("actions").MakeRng());
  const BatchPolicy act = [&](std::span<const double> observations, int n, std::span<double> actions) {
    sampled(observations, n, actions);
    // D4RL's files hold float32: what is logged is what was done.
    for (double& a : actions) a = static_cast<double>(static_cast<float>(a));
  };
  EpisodeRecorder recorder(n_episodes, LogPrecision::kFloat);
  RunEpisodes(*simulator, std::vector<std::vector<double>>(static_cast<size_t>(n_episodes), z), act,
              key.Stage("episodes"), recorder.Observer());
  if (recorder.n_diverged() > 0) {
    throw DataError("the target diverged while demonstrations were logged; choose target parameters nearer to nominal");
  }
  return recorder.Logs();
}

}  // namespace oted
