#include "oted/collect/demonstrations.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/rl/batch_policy.h"
#include "oted/rl/policy_evaluation.h"
#include "oted/rl/starts.h"
#include "oted/sim/episode_recorder.h"
#include "oted/stages/agent/agent.h"

namespace oted {
namespace {

constexpr int kJudgeEpisodes = 20;
constexpr size_t kExpertCandidates = 5;

double RandomReturn(const SimulatorFactory& factory, const std::vector<double>& z, RngKey key, int n_threads) {
  const auto simulator = factory.Make(kJudgeEpisodes, n_threads);
  Rng rng = key.Stage("actions").MakeRng();
  return MeanReturn(
      RunEpisodes(*simulator, std::vector(kJudgeEpisodes, z), UniformRandomPolicy(factory.spec(), rng), key));
}

constexpr LogPrecision kAsLogged = LogPrecision::kFloat;

/// D4RL's files hold float32: what is logged is what was done.
void RoundToFloat(std::span<double> actions) {
  for (double& a : actions) a = static_cast<double>(static_cast<float>(a));
}

constexpr const char* kIdentityFile = "behavior.json";

const char* AlgorithmOf(const BehaviorTraining& training) {
  return std::holds_alternative<SacConfig>(training.agent) ? "sac" : "crossq";
}
nlohmann::json SettingsOf(const BehaviorTraining& training) {
  return std::visit([](auto settings) { return settings.Fields().ToJson(); }, training.agent);
}

RngKey BehaviorKey(const BehaviorTraining& training) { return RngKey(training.seed).Stage("behavior policies"); }

nlohmann::json IdentityOf(const BehaviorTraining& training) {
  const SimulatorFactory& factory = training.factory;
  nlohmann::json parameters = nlohmann::json::object();
  for (int i = 0; i < factory.parameters().size(); ++i) {
    const ParameterSpec& spec = factory.parameters()[i];
    const bool is_multiple = spec.IsMultiple();
    parameters[spec.field + (is_multiple ? "" : " (absolute)")] = training.z[static_cast<size_t>(i)];
  }
  return {{"schema", "oted.behavior/1"}, {"task", training.task}, {"model", factory.model_sha256()},
          {"parameters", parameters},    {"seed", training.seed}, {AlgorithmOf(training), SettingsOf(training)}};
}

/// Setting by setting: "sac.gamma", "seed".
std::map<std::string, nlohmann::json> Settings(const nlohmann::json& identity) {
  std::map<std::string, nlohmann::json> settings;
  for (const auto& [key, value] : identity.items()) {
    if (!value.is_object()) {
      settings[key] = value;
      continue;
    }
    for (const auto& [name, setting] : value.items()) settings[fmt::format("{}.{}", key, name)] = setting;
  }
  return settings;
}

/// Whether a training with these settings begins several times, and keeps the best start.
bool ChoosesStart(const nlohmann::json& settings) {
  const auto at = [&](const char* name) { return settings.contains(name) ? settings[name] : nlohmann::json(); };
  return at("n_starts") > 1 && at("start_steps") < at("n_steps");
}

/// What of a training is not as it began, in words. More steps of the same are no difference.
std::vector<std::string> Differences(const nlohmann::json& before, const nlohmann::json& now) {
  const auto old_settings = Settings(before), new_settings = Settings(now);
  auto all = old_settings;
  all.insert(new_settings.begin(), new_settings.end());
  const auto value = [](const auto& settings, const std::string& key) {
    const auto found = settings.find(key);
    return found == settings.end() ? nlohmann::json("none") : found->second;
  };
  std::vector<std::string> differ;
  for (const auto& [key, unused] : all) {
    const nlohmann::json was = value(old_settings, key), is = value(new_settings, key);
    if (was == is) continue;
    const std::string section = key.substr(0, key.find('.'));
    const bool goes_on = key.ends_with(".n_steps") && is.is_number() && was.is_number() && is > was &&
                         ChoosesStart(before[section]) == ChoosesStart(now[section]);
    if (!goes_on) differ.push_back(fmt::format("{} {}, not {}", key, was.dump(), is.dump()));
  }
  return differ;
}

/// @throws UsageError where `folder` holds another training, naming what differs
void CheckSameTraining(const std::filesystem::path& folder, const nlohmann::json& identity) {
  const std::filesystem::path file = folder / kIdentityFile;
  const auto has = [&](const char* name) { return std::filesystem::exists(folder / name); };
  if (std::filesystem::exists(file)) {
    const nlohmann::json before = ReadJson(file);
    if (!before.is_object()) throw DataError(fmt::format("'{}' is damaged; choose another --out", file.string()));
    const std::vector<std::string> differ = Differences(before, identity);
    if (!differ.empty()) {
      throw UsageError(
          fmt::format("'{}' holds a training with {}; only more n_steps of the same go on there, beyond start_steps or "
                      "not as it was: choose another --out, or remove it",
                      folder.string(), fmt::join(differ, "; ")));
    }
  } else if (has("checkpoint.npz") || has("training.json") || has(kStartsFolder)) {
    throw UsageError(fmt::format("'{}' holds a training, and no {} that says of what; choose another --out",
                                 folder.string(), kIdentityFile));
  }
  WriteJson(file, identity);
}

std::filesystem::path SnapshotFile(const std::filesystem::path& folder, int64_t step) {
  return folder / "snapshots" / (std::to_string(step) + ".npz");
}

/// The policies that a training evaluated, judged in the same fresh episodes. What it is given must outlive it.
class Snapshots {
 public:
  Snapshots(const BehaviorTraining& training, const ReplayAgent& trained, std::filesystem::path folder,
            const RunContext& context)
      : training_(training), trained_(trained), folder_(std::move(folder)), context_(context) {}

  int64_t step(size_t i) const { return trained_.eval_steps[i]; }
  TanhGaussianPolicy Load(size_t i) const { return TanhGaussianPolicy::Load(SnapshotFile(folder_, step(i))); }

  /// Each is judged once.
  EvaluatedReturn Judge(size_t i) {
    if (const auto known = judged_.find(i); known != judged_.end()) return known->second;
    const std::vector<EpisodeResult> episodes = RunPolicy(training_.factory, Load(i),
                                                          {.z = {training_.z},
                                                           .n_episodes = kJudgeEpisodes,
                                                           .key = BehaviorKey(training_).Stage("judge"),
                                                           .n_threads = context_.n_threads});
    context_.ThrowIfStopped();
    return judged_[i] = {MeanReturn(episodes), CountDiverged(episodes) == kJudgeEpisodes};
  }

  /// Of the policy that the training kept, whose return tells of whole episodes where any policy had them, and of those
  /// that a few episodes found as good: the luckiest of many evaluations need not be the best.
  size_t Best() {
    const std::vector<double>& returns = trained_.eval_returns;
    auto best = static_cast<size_t>(std::ranges::find(returns, trained_.eval_return) - returns.begin());
    OTED_CHECK(best < returns.size());
    std::vector<size_t> order(returns.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::ranges::stable_sort(order, std::greater<>(), [&](size_t i) { return returns[i]; });
    order.resize(std::min(order.size(), kExpertCandidates));
    for (const size_t i : order) {
      if (Judge(i).IsBetterThan(Judge(best))) best = i;
    }
    return best;
  }

  /// Takes the medium policy. It comes on the way up: each until `expert` gets as many episodes as the expert, as the
  /// learning curve's few would misjudge it.
  /// @return their returns
  std::vector<double> FindMedium(size_t expert, BehaviorPolicies& result) {
    const double third = result.random_return + (result.expert_return - result.random_return) / 3;
    std::vector<double> judged;
    for (size_t i = 0; i <= expert; ++i) {
      const double mean_return = Judge(i).mean_return;
      judged.push_back(mean_return);
      context_.log->Progress("judge", "snapshots", static_cast<int64_t>(i + 1), static_cast<int64_t>(expert + 1), "");
      if (i > 0 && std::abs(mean_return - third) >= std::abs(result.medium_return - third)) continue;
      result.medium_step = step(i);
      result.medium = Load(i);
      result.medium_return = mean_return;
    }
    result.medium_is_near = std::abs(result.medium_return - third) <= std::abs(result.expert_return - third) / 2;
    return judged;
  }

 private:
  const BehaviorTraining& training_;
  const ReplayAgent& trained_;
  std::filesystem::path folder_;
  const RunContext& context_;
  std::map<size_t, EvaluatedReturn> judged_;
};

Dataset CheckedLogs(const EpisodeRecorder& recorder) {
  if (recorder.n_diverged() > 0) {
    throw DataError(
        "the target diverged while demonstrations were logged; choose target parameters nearer to nominal, or a "
        "gentler policy");
  }
  return recorder.Logs();
}

}  // namespace

BehaviorPolicies TrainBehaviorPolicies(const BehaviorTraining& training, const std::filesystem::path& folder,
                                       const RunContext& context) {
  const SimulatorFactory& factory = training.factory;
  const std::vector<double>& z = training.z;
  const nlohmann::json identity = IdentityOf(training);
  CheckSameTraining(folder, identity);
  const RngKey key = BehaviorKey(training);
  DrawnEpisodes source([&](Rng&) { return z; });
  const auto train = [&](const auto& config) {
    return TrainAgent(
        {.factory = factory,
         .source = source,
         .eval_parameters = {z},
         .key = key,
         .folder = folder,
         .run_name = "behavior",
         .context = context,
         .observer = [&](int64_t step, const Policy& policy, double) { policy.Save(SnapshotFile(folder, step)); }},
        config);
  };
  const ReplayAgent trained = std::visit(train, training.agent);

  Snapshots snapshots(training, trained, folder, context);
  const size_t expert = snapshots.Best();
  BehaviorPolicies result;
  result.expert_step = snapshots.step(expert);
  result.expert = snapshots.Load(expert);
  result.expert_return = snapshots.Judge(expert).mean_return;
  result.random_return = RandomReturn(factory, z, key.Stage("random"), context.n_threads);
  const std::vector<double> judged = snapshots.FindMedium(expert, result);
  if (!(result.expert_return > result.random_return)) {
    context.log->Warning(fmt::format(
        "the expert earns {:.4g}, and random actions {:.4g}: it learned nothing; look at the reward's size, "
        "train longer or lower {}.learning_rate",
        result.expert_return, result.random_return, AlgorithmOf(training)));
  }

  const SimulatorSpec& spec = factory.spec();
  const auto describe = [&](int64_t step, double mean_return) {
    nlohmann::json entry = {{"step", step}, {"mean_return", mean_return}};
    if (spec.has_score()) entry["score"] = spec.NormalizedScore(mean_return);
    return entry;
  };
  nlohmann::json record = {
      {"task", spec.task},
      {"seed", training.seed},
      {"parameters", identity["parameters"]},
      {"episodes", kJudgeEpisodes},
      {"expert", describe(result.expert_step, result.expert_return)},
      {"medium", describe(result.medium_step, result.medium_return)},
      {"random", describe(0, result.random_return)},
      {"learning_curve", {{"step", trained.eval_steps}, {"mean_return", trained.eval_returns}, {"judged", judged}}}};
  record[AlgorithmOf(training)] = SettingsOf(training);
  result.expert.Save(folder / "expert.npz");
  result.medium.Save(folder / "medium.npz");
  WriteJson(folder / "training.json", record);
  return result;
}

Dataset CollectExcitation(const SimulatorFactory& factory, const std::vector<double>& z, const Excitation& excitation,
                          int n_episodes, RngKey key, int n_threads) {
  const bool has_reward = factory.spec().has_reward;
  std::vector<EpisodeRecorder> episodes(static_cast<size_t>(n_episodes), EpisodeRecorder(1, kAsLogged, has_reward));
  ParallelFor(n_episodes, n_threads, [&](int i) {
    const auto simulator = factory.Make(1, 1);
    const RngKey episode = key.Index(static_cast<uint64_t>(i));
    OpenLoop actions(excitation, factory.spec(), episode.Stage("actions"));
    const auto act = [&](std::span<const double>, int, std::span<double> out) {
      actions.Next(out);
      RoundToFloat(out);
    };
    RunEpisodes(*simulator, {z}, act, episode.Stage("episodes"), episodes[static_cast<size_t>(i)].Observer());
  });
  Dataset dataset;
  for (const EpisodeRecorder& episode : episodes) dataset.Append(CheckedLogs(episode));
  return dataset;
}

Dataset CollectDemonstrations(const SimulatorFactory& factory, const std::vector<double>& z,
                              const TanhGaussianPolicy& policy, int n_episodes, RngKey key, int n_threads) {
  const auto simulator = factory.Make(n_episodes, n_threads);
  const BatchPolicy sampled = AsBatchPolicy(policy, ActionNoise::kSampled, key.Stage("actions").MakeRng());
  const BatchPolicy act = [&](std::span<const double> observations, int n, std::span<double> actions) {
    sampled(observations, n, actions);
    RoundToFloat(actions);
  };
  EpisodeRecorder recorder(n_episodes, kAsLogged, factory.spec().has_reward);
  RunEpisodes(*simulator, std::vector<std::vector<double>>(static_cast<size_t>(n_episodes), z), act,
              key.Stage("episodes"), recorder.Observer());
  return CheckedLogs(recorder);
}

}  // namespace oted
