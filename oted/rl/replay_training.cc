#include "oted/rl/replay_training.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/rl/replay_buffer.h"

namespace oted {

void ReplayConfig::AddFields(FieldList& fields) {
  fields.Add("n_steps", &n_steps, "control steps that one agent trains for, over all lanes", AtLeast(1));
  fields.Add("n_lanes", &n_lanes, "simulators stepped together", AtLeast(1));
  fields.Add("updates_per_step", &updates_per_step, "gradient steps per control step", Above(0));
  fields.Add("learning_starts", &learning_starts, "control steps with uniform random actions before the first update",
             AtLeast(1));
  fields.Add("batch_size", &batch_size, "transitions per gradient step", AtLeast(1));
  fields.Add("buffer_size", &buffer_size, "transitions kept for replay", AtLeast(1));
  fields.Add("learning_rate", &learning_rate, "Adam's step size for actor, critics and temperature", Above(0));
  fields.Add("gamma", &gamma, "discount factor", Between(0, 1));
  fields.Add("eval_interval", &eval_interval, "control steps between evaluations and checkpoints", AtLeast(1));
  fields.Add("eval_episodes", &eval_episodes, "episodes per evaluation", AtLeast(1));
  fields.AddChoice("keep", &keep, "policy that training returns: the best evaluated one, or the last",
                   {"best", "last"});
}

namespace {

Normalizer IdentityNormalizer(int dim) {
  return {std::vector<double>(static_cast<size_t>(dim), 0.0), std::vector<double>(static_cast<size_t>(dim), 1.0)};
}

/// The state of one training run between segments, and its segment.
class ReplayTraining : public Learner {
 public:
  ReplayTraining(const SimulatorFactory& factory, EpisodeSource& source, const ReplayConfig& config,
                 const MakeReplayUpdate& make_update, RngKey key, int n_threads)
      : config_(config),
        source_(source),
        simulator_(factory.Make(config.n_lanes, n_threads)),
        spec_(factory.spec()),
        rng_(key.Stage("training").MakeRng()),
        episodes_(config.n_lanes),
        buffer_(spec_.obs_dim(), spec_.act_dim, std::min(config.buffer_size, config.n_steps + config.n_lanes)) {
    Rng init = key.Stage("initialisation").MakeRng();
    TanhGaussianPolicy actor(IdentityNormalizer(spec_.obs_dim()), config.hidden, spec_.action_low, spec_.action_high);
    update_ = make_update(std::move(actor), init);
  }

  int64_t n_steps() const override { return n_steps_; }
  const TanhGaussianPolicy& policy() const override { return update_->actor(); }
  std::span<const float> policy_parameters() const override { return update_->actor().net().parameters(); }
  const EpisodeStatistics& episodes() const override { return episodes_; }
  std::vector<std::pair<std::string, double>> Losses() const override {
    std::vector<std::pair<std::string, double>> figures = {{"train/critic_loss", losses_.critic_loss},
                                                           {"train/actor_loss", losses_.actor_loss},
                                                           {"train/ent_coef", losses_.alpha},
                                                           {"train/ent_coef_loss", losses_.alpha_loss}};
    for (auto& figure : source_.Figures()) figures.push_back(std::move(figure));
    return figures;
  }

  void RunSegment(int64_t end, const std::function<void()>& tick) override {
    const size_t n_lanes = static_cast<size_t>(config_.n_lanes);
    const size_t obs_dim = static_cast<size_t>(spec_.obs_dim()), act_dim = static_cast<size_t>(spec_.act_dim);
    std::vector<int> lanes(n_lanes);
    std::vector<double> observations(n_lanes * obs_dim), actions(n_lanes * act_dim), squashed(act_dim);
    episodes_.Begin();
    for (size_t lane = 0; lane < n_lanes; ++lane) {
      lanes[lane] = static_cast<int>(lane);
      StartEpisode(*simulator_, lanes[lane], source_, rng_);
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
          episodes_.AddStep(lanes[lane], simulator_->reward(lanes[lane]));
        }
        if (status != LaneStatus::kRunning) {
          source_.EpisodeEnded(lanes[lane], episodes_.EndEpisode(lanes[lane]), status == LaneStatus::kDiverged);
          StartEpisode(*simulator_, lanes[lane], source_, rng_);
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

  void Save(NpzArrays& arrays) override {
    update_->Save(arrays);
    source_.Save(arrays);
    arrays["buffer/rows"] = NpyArray(std::vector<float>(buffer_.rows().begin(), buffer_.rows().end()));
    arrays["counters"] = NpyArray(std::vector<int64_t>{n_steps_, n_updates_, buffer_.next()});
    arrays["owed_updates"] = NpyArray(std::vector<double>{owed_updates_});
    arrays["rng"] = RngArray(rng_);
  }

  void Restore(const NpzArrays& arrays) override {
    update_->Restore(arrays);
    source_.Restore(arrays);
    const auto& counters = CheckpointValues<int64_t>(arrays, "counters", 3);
    n_steps_ = counters[0];
    n_updates_ = counters[1];
    buffer_.Restore(std::get<std::vector<float>>(arrays.at("buffer/rows").values), counters[2]);
    owed_updates_ = CheckpointValues<double>(arrays, "owed_updates", 1)[0];
    RestoreRng(arrays, "rng", rng_);
  }

 private:
  const ReplayConfig& config_;
  EpisodeSource& source_;
  std::unique_ptr<Simulator> simulator_;
  const SimulatorSpec& spec_;
  Rng rng_;
  EpisodeStatistics episodes_;
  ReplayBuffer buffer_;
  std::unique_ptr<ReplayUpdate> update_;
  TransitionBatch batch_;
  ReplayLosses losses_;
  int64_t n_steps_ = 0, n_updates_ = 0;
  double owed_updates_ = 0;
};

}  // namespace

ReplayAgent TrainByReplay(const SimulatorFactory& factory, EpisodeSource& source,
                          const std::vector<std::vector<double>>& eval_parameters, const ReplayConfig& config,
                          const std::string& algorithm, const MakeReplayUpdate& make_update, RngKey key,
                          const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                          const ReplayObserver& observer) {
  if (factory.spec().n_discrete_actions > 0) {
    throw UsageError(
        fmt::format("task '{}' has discrete actions, {} takes continuous ones alone", factory.spec().task, algorithm));
  }
  ReplayTraining training(factory, source, config, make_update, key, context.n_threads);
  const auto observe = [&](int64_t step, double eval_return) {
    if (observer) observer(step, training.policy(), eval_return);
  };
  ReplayAgent result;
  static_cast<LearningCurve&>(result) = TrainInSegments(
      training, factory, eval_parameters, {config.n_steps, config.eval_interval, config.eval_episodes, config.keep},
      key, folder, run_name, context, observe);
  result.policy = training.policy();
  std::copy(result.kept.begin(), result.kept.end(), result.policy.net().parameters().begin());
  return result;
}

}  // namespace oted
