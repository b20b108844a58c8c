#include "oted/rl/sac.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "oted/base/error.h"
#include "oted/base/statistics.h"
#include "oted/data/npz.h"
#include "oted/rl/batch_policy.h"
#include "oted/rl/replay_buffer.h"
#include "oted/rl/sac_update.h"

namespace oted {

FieldList SacConfig::Fields(const std::string& section) {
  FieldList fields(section);
  fields.Add("n_steps", &n_steps, "control steps that one agent trains for, over all lanes", AtLeast(1));
  fields.Add("n_lanes", &n_lanes, "simulators stepped together", AtLeast(1));
  fields.Add("updates_per_step", &updates_per_step, "gradient steps per control step", Above(0));
  fields.Add("learning_starts", &learning_starts, "control steps with uniform random actions before the first update",
             AtLeast(1));
  fields.Add("batch_size", &batch_size, "transitions per gradient step", AtLeast(1));
  fields.Add("buffer_size", &buffer_size, "transitions kept for replay", AtLeast(1));
  fields.Add("hidden", &hidden, "widths of the hidden layers of actor and critics", AtLeast(1));
  fields.Add("learning_rate", &learning_rate, "Adam's step size for actor, critics and temperature", Above(0));
  fields.Add("gamma", &gamma, "discount factor", Between(0, 1));
  fields.Add("tau", &tau, "Polyak step of the target critics", AboveUpTo(0, 1));
  fields.Add("eval_interval", &eval_interval, "control steps between evaluations and checkpoints", AtLeast(1));
  fields.Add("eval_episodes", &eval_episodes, "episodes per evaluation", AtLeast(1));
  fields.AddChoice("keep", &keep, "policy that training returns: the best evaluated one, or the last",
                   {"best", "last"});
  return fields;
}

std::vector<EpisodeResult> RunPolicy(const SimulatorFactory& factory, const TanhGaussianPolicy& policy,
                                     const std::vector<std::vector<double>>& z, int n_episodes, int n_threads,
                                     RngKey key) {
  OTED_CHECK(!z.empty());
  const auto simulator = factory.Make(n_episodes, n_threads);
  std::vector<std::vector<double>> lane_z;
  for (int k = 0; k < n_episodes; ++k) lane_z.push_back(z[static_cast<size_t>(k) % z.size()]);
  return RunEpisodes(*simulator, lane_z, MeanActionPolicy(policy), key);
}

double EvaluatePolicy(const SimulatorFactory& factory, const TanhGaussianPolicy& policy,
                      const std::vector<std::vector<double>>& z, int n_episodes, int n_threads, RngKey key) {
  return MeanReturn(RunPolicy(factory, policy, z, n_episodes, n_threads, key));
}

namespace {

Normalizer IdentityNormalizer(int dim) {
  return {std::vector<double>(static_cast<size_t>(dim), 0.0), std::vector<double>(static_cast<size_t>(dim), 1.0)};
}

/// A checkpoint's array of `size` numbers, stored as T.
template <class T>
const std::vector<T>& Values(const NpzArrays& arrays, const char* name, size_t size) {
  const auto found = arrays.find(name);
  const std::vector<T>* values = found == arrays.end() ? nullptr : std::get_if<std::vector<T>>(&found->second.values);
  if (values == nullptr || values->size() != size) throw DataError(fmt::format("no fitting array '{}'", name));
  return *values;
}

/// The state of one training run between segments, and its segment.
class SacTraining {
 public:
  SacTraining(const SimulatorFactory& factory, const EpisodeParameters& episode_parameters, const SacConfig& config,
              RngKey key, int n_threads)
      : config_(config),
        factory_(factory),
        episode_parameters_(episode_parameters),
        simulator_(factory.Make(config.n_lanes, n_threads)),
        spec_(factory.spec()),
        rng_(key.Stage("training").MakeRng()),
        buffer_(spec_.obs_dim(), spec_.act_dim, std::min(config.buffer_size, config.n_steps + config.n_lanes)) {
    Rng init = key.Stage("initialisation").MakeRng();
    TanhGaussianPolicy actor(IdentityNormalizer(spec_.obs_dim()), config.hidden, spec_.action_low, spec_.action_high);
    actor.net().Initialize(init);
    update_.emplace(std::move(actor), config.hidden,
                    SacUpdateOptions{.learning_rate = config.learning_rate,
                                     .gamma = config.gamma,
                                     .tau = config.tau,
                                     .target_entropy = -static_cast<double>(spec_.act_dim)},
                    init);
  }

  int64_t n_steps() const { return n_steps_; }
  const TanhGaussianPolicy& policy() const { return update_->actor(); }
  const SacLosses& last_losses() const { return losses_; }
  const std::vector<double>& segment_returns() const { return segment_returns_; }
  const std::vector<double>& segment_lengths() const { return segment_lengths_; }

  /// Trains until `end` control steps have been made; `tick` is called now and then.
  void RunSegment(int64_t end, const std::function<void()>& tick) {
    const size_t n_lanes = static_cast<size_t>(config_.n_lanes);
    const size_t obs_dim = static_cast<size_t>(spec_.obs_dim()), act_dim = static_cast<size_t>(spec_.act_dim);
    std::vector<int> lanes(n_lanes);
    std::vector<double> observations(n_lanes * obs_dim), actions(n_lanes * act_dim), squashed(act_dim);
    std::vector<double> returns(n_lanes, 0), lengths(n_lanes, 0);
    segment_returns_.clear();
    segment_lengths_.clear();
    for (size_t lane = 0; lane < n_lanes; ++lane) {
      lanes[lane] = static_cast<int>(lane);
      StartEpisode(static_cast<int>(lane));
    }
    PolicyRunner runner(update_->actor(), ActionNoise::kSampled);
    while (n_steps_ < end) {
      for (size_t lane = 0; lane < n_lanes; ++lane) {
        const auto observation = simulator_->observation(lanes[lane]);
        std::copy(observation.begin(), observation.end(),
                  observations.begin() + static_cast<ptrdiff_t>(lane * obs_dim));
      }
      if (n_steps_ < config_.learning_starts) {
        for (size_t i = 0; i < actions.size(); ++i) {
          actions[i] = rng_.Uniform(spec_.action_low[i % act_dim], spec_.action_high[i % act_dim]);
        }
      } else {
        runner.Act(observations, config_.n_lanes, rng_, actions);
      }
      simulator_->Step(lanes, actions);
      for (size_t lane = 0; lane < n_lanes; ++lane) {
        const LaneStatus status = simulator_->status(lanes[lane]);
        if (status != LaneStatus::kDiverged) {
          for (size_t j = 0; j < act_dim; ++j) {
            const double low = spec_.action_low[j], high = spec_.action_high[j];
            squashed[j] = (2 * actions[lane * act_dim + j] - low - high) / (high - low);
          }
          buffer_.Add({observations.data() + lane * obs_dim, obs_dim}, squashed, simulator_->reward(lanes[lane]),
                      simulator_->observation(lanes[lane]), status == LaneStatus::kTerminated);
          returns[lane] += simulator_->reward(lanes[lane]);
          lengths[lane] += 1;
        }
        if (status != LaneStatus::kRunning) {
          segment_returns_.push_back(returns[lane]);
          segment_lengths_.push_back(lengths[lane]);
          returns[lane] = lengths[lane] = 0;
          StartEpisode(lanes[lane]);
        }
      }
      n_steps_ += config_.n_lanes;
      if (n_steps_ < config_.learning_starts || buffer_.size() == 0) continue;
      for (owed_updates_ += config_.updates_per_step * config_.n_lanes; owed_updates_ >= 1; owed_updates_ -= 1) {
        buffer_.Sample(config_.batch_size, rng_, batch_);
        losses_ = update_->Step(batch_);
        if (++n_updates_ % 256 == 0) tick();
      }
    }
  }

  void Save(NpzArrays& arrays) {
    update_->Save(arrays);
    arrays["buffer/rows"] = NpyArray(std::vector<float>(buffer_.rows().begin(), buffer_.rows().end()));
    arrays["counters"] = NpyArray(std::vector<int64_t>{n_steps_, n_updates_, buffer_.next()});
    arrays["owed_updates"] = NpyArray(std::vector<double>{owed_updates_});
    std::vector<int64_t> words;
    for (const uint64_t word : rng_.state()) words.push_back(static_cast<int64_t>(word));
    arrays["rng"] = NpyArray(words);
  }

  void Restore(const NpzArrays& arrays) {
    update_->Restore(arrays);
    const auto& counters = Values<int64_t>(arrays, "counters", 3);
    n_steps_ = counters[0];
    n_updates_ = counters[1];
    buffer_.Restore(std::get<std::vector<float>>(arrays.at("buffer/rows").values), counters[2]);
    owed_updates_ = Values<double>(arrays, "owed_updates", 1)[0];
    Rng::State state;
    const auto& words = Values<int64_t>(arrays, "rng", state.size());
    for (size_t i = 0; i < state.size(); ++i) state[i] = static_cast<uint64_t>(words[i]);
    rng_.set_state(state);
  }

 private:
  /// Algorithm 2, line 1: parameters are drawn anew for each episode.
  void StartEpisode(int lane) {
    simulator_->SetParameters(lane, episode_parameters_(rng_));
    simulator_->Reset(lane, rng_);
  }

  const SacConfig& config_;
  const SimulatorFactory& factory_;
  const EpisodeParameters& episode_parameters_;
  std::unique_ptr<Simulator> simulator_;
  const SimulatorSpec& spec_;
  Rng rng_;
  ReplayBuffer buffer_;
  std::optional<SacUpdate> update_;
  SacBatch batch_;
  SacLosses losses_;
  int64_t n_steps_ = 0, n_updates_ = 0;
  double owed_updates_ = 0;
  std::vector<double> segment_returns_, segment_lengths_;
};

void SaveCheckpoint(SacTraining& training, const SacResult& result, const std::filesystem::path& folder) {
  NpzArrays arrays;
  training.Save(arrays);
  arrays["eval/steps"] = NpyArray(result.eval_steps);
  arrays["eval/returns"] = NpyArray(result.eval_returns);
  arrays["eval/best"] = NpyArray(std::vector<double>{result.eval_return, static_cast<double>(result.n_diverged)});
  const auto& best = result.policy.net().parameters();
  arrays["best"] = NpyArray(std::vector<float>(best.begin(), best.end()));
  WriteNpz(arrays, folder / "checkpoint.npz");
}

void RestoreCheckpoint(SacTraining& training, SacResult& result, const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "checkpoint.npz";
  const NpzArrays arrays = ReadNpz(path);
  try {
    training.Restore(arrays);
    result.eval_steps = std::get<std::vector<int64_t>>(arrays.at("eval/steps").values);
    result.eval_returns = Values<double>(arrays, "eval/returns", result.eval_steps.size());
    const auto& kept = Values<double>(arrays, "eval/best", 2);
    result.eval_return = kept[0];
    result.n_diverged = static_cast<int>(kept[1]);
    result.policy = training.policy();
    const auto& best = Values<float>(arrays, "best", result.policy.net().n_parameters());
    std::copy(best.begin(), best.end(), result.policy.net().parameters().begin());
  } catch (const std::exception& e) {
    // Whatever a file makes fail here is the file's fault, or that of a configuration which is not its own.
    throw DataError(fmt::format("checkpoint '{}' does not fit this agent ({}); remove it to start the agent anew",
                                path.string(), e.what()));
  }
}

}  // namespace

SacResult TrainSac(const SimulatorFactory& factory, const EpisodeParameters& episode_parameters,
                   const std::vector<std::vector<double>>& eval_parameters, const SacConfig& config, RngKey key,
                   const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                   const SacObserver& observer) {
  if (factory.spec().n_discrete_actions > 0) {
    throw UsageError(
        fmt::format("task '{}' has discrete actions, SAC takes continuous ones alone", factory.spec().task));
  }
  SacTraining training(factory, episode_parameters, config, key, context.n_threads);
  SacResult result;
  if (std::filesystem::exists(folder / "checkpoint.npz")) RestoreCheckpoint(training, result, folder);

  while (training.n_steps() < config.n_steps) {
    const int64_t end = std::min(config.n_steps, training.n_steps() + config.eval_interval);
    training.RunSegment(end, [&] {
      context.log->Progress(
          "train", run_name, training.n_steps(), config.n_steps,
          result.eval_returns.empty() ? "" : fmt::format("return {:.0f}", result.eval_returns.back()));
    });
    const std::vector<EpisodeResult> episodes = RunPolicy(
        factory, training.policy(), eval_parameters, config.eval_episodes, context.n_threads, key.Stage("evaluation"));
    const double eval_return = MeanReturn(episodes);
    const int n_diverged = CountDiverged(episodes);
    const auto failed = [&](int n) { return n == config.eval_episodes; };
    const bool better =
        failed(n_diverged) != failed(result.n_diverged) ? failed(result.n_diverged) : eval_return > result.eval_return;
    if (config.keep == "last" || result.eval_returns.empty() || better) {
      result.eval_return = eval_return;
      result.n_diverged = n_diverged;
      result.policy = training.policy();
    }
    const int64_t step = training.n_steps();
    if (observer) observer(step, training.policy(), eval_return);
    result.eval_steps.push_back(step);
    result.eval_returns.push_back(eval_return);
    const SacLosses& losses = training.last_losses();
    context.log->Scalar(run_name, "eval/mean_reward", step, eval_return);
    context.log->Scalar(run_name, "rollout/ep_rew_mean", step, Mean(training.segment_returns()));
    context.log->Scalar(run_name, "rollout/ep_len_mean", step, Mean(training.segment_lengths()));
    context.log->Scalar(run_name, "train/critic_loss", step, losses.critic_loss);
    context.log->Scalar(run_name, "train/actor_loss", step, losses.actor_loss);
    context.log->Scalar(run_name, "train/ent_coef", step, losses.alpha);
    context.log->Scalar(run_name, "train/ent_coef_loss", step, losses.alpha_loss);
    context.log->Progress("train", run_name, step, config.n_steps, fmt::format("return {:.0f}", eval_return));
    SaveCheckpoint(training, result, folder);
    context.ThrowIfStopped();
  }
  return result;
}

}  // namespace oted
