#include "oted/baselines/fisher_brc.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "oted/base/sizes.h"
#include "oted/rl/learned_state.h"
#include "oted/rl/offline/fisher_brc_update.h"
#include "oted/rl/offline/offline_rows.h"
#include "oted/rl/training.h"
#include "oted/stages/clone/behavioral_cloning.h"

namespace oted {

FieldList FisherBrcConfig::Fields() {
  FieldList fields("f_brc");
  fields.Add("behavior_steps", &behavior_steps, "gradient steps of the behaviour policy, at most", AtLeast(1));
  fields.Add("behavior_hidden", &behavior_hidden, "widths of its hidden layers", LayerWidths());
  fields.Add("behavior_rate", &behavior_rate,
             "Adam's step size for it; a tenth from 80 % of its steps on, a hundredth from 90 %", Above(0));
  fields.Add("held_out", &held_out, "fraction of the transitions held out to stop it early", Between(0.01, 0.5));
  fields.Add("check_interval", &check_interval, "steps between checks of the held-out likelihood", AtLeast(1));
  fields.Add("patience", &patience, "checks without a better one after which it stops", AtLeast(1));
  fields.Add("n_steps", &n_steps, "gradient steps of actor and critics after that", AtLeast(1));
  fields.Add("batch_size", &batch_size, "logged transitions per gradient step", BatchSizes());
  fields.Add("hidden", &hidden, "widths of the hidden layers of actor and critics", LayerWidths());
  fields.Add("learning_rate", &learning_rate, "Adam's step size for actor, critics and temperature", Above(0));
  fields.Add("gamma", &gamma, "discount factor", Between(0, 1));
  fields.Add("tau", &tau, "Polyak step of the target critics", AboveUpTo(0, 1));
  fields.Add("gradient_penalty", &gradient_penalty, "weight of the slope of the critics' offsets", AtLeast(0));
  fields.Add("reward_bonus", &reward_bonus, "added to every reward");
  return fields;
}

namespace {

/// Weights with orthonormal rows or columns, whichever are fewer, times a gain; biases are zero.
void InitialiseOrthogonally(Mlp& net, double last_gain, Rng& rng) {
  for (const Mlp::Layer& layer : net.layers()) {
    const bool is_last = &layer == &net.layers().back();
    const double gain = is_last ? last_gain : std::sqrt(2.0);
    const size_t n = static_cast<size_t>(std::min(layer.in, layer.out)),
                 length = static_cast<size_t>(std::max(layer.in, layer.out));
    // Gram and Schmidt's vectors, one after the other.
    std::vector<std::vector<double>> vectors;
    while (vectors.size() < n) {
      std::vector<double> v(length);
      for (double& x : v) x = rng.Normal();
      for (const auto& former : vectors) {
        double product = 0;
        for (size_t k = 0; k < length; ++k) product += v[k] * former[k];
        for (size_t k = 0; k < length; ++k) v[k] -= product * former[k];
      }
      double square = 0;
      for (const double x : v) square += x * x;
      for (double& x : v) x /= std::sqrt(square);
      vectors.push_back(std::move(v));
    }
    float* weight = net.parameters().data() + layer.weight;
    for (size_t i = 0; i < static_cast<size_t>(layer.in); ++i) {
      for (size_t j = 0; j < static_cast<size_t>(layer.out); ++j) {
        const double v = layer.in <= layer.out ? vectors[i][j] : vectors[j][i];
        weight[i * static_cast<size_t>(layer.out) + j] = static_cast<float>(gain * v);
      }
    }
    std::fill_n(net.parameters().data() + layer.bias, layer.out, 0.0f);
  }
}

/// The start of all networks, drawn one after the other.
struct FisherBrcStart {
  TanhGaussianPolicy actor;
  Mlp offsets[2], mixture;
};

FisherBrcStart StartOf(const OfflineJob& job, const FisherBrcConfig& config, const Normalizer& normalizer) {
  constexpr double kLastGain = 0.01;
  Rng rng = job.key.Stage("start").MakeRng();
  FisherBrcStart start{{normalizer, config.hidden, job.spec.action_low, job.spec.action_high},
                       {},
                       MixtureNet(job.spec.obs_dim(), config.behavior_hidden, job.spec.act_dim)};
  InitialiseOrthogonally(start.mixture, kLastGain, rng);
  InitialiseOrthogonally(start.actor.net(), kLastGain, rng);
  for (Mlp& offset : start.offsets) {
    offset = Mlp(job.spec.obs_dim() + job.spec.act_dim, config.hidden, 1);
    InitialiseOrthogonally(offset, kLastGain, rng);
  }
  return start;
}

class FisherBrcLearner : public OfflineLearner {
 public:
  FisherBrcLearner(const OfflineJob& job, const FisherBrcConfig& config, const Normalizer& normalizer,
                   const CloneRowSplit& split, FisherBrcStart start)
      : config_(config),
        act_dim_(job.spec.act_dim),
        rng_(job.key.Stage("training").MakeRng()),
        all_(job.dataset, job.spec, normalizer, OfflineRowChoice::kAll),
        train_(job.dataset, job.spec, normalizer, OfflineRowChoice::kAll, split.train),
        behavior_(start.mixture, config.behavior_rate),
        update_(std::move(start.actor), std::move(start.offsets[0]), std::move(start.offsets[1]),
                std::move(start.mixture),
                {.learning_rate = config.learning_rate,
                 .gamma = config.gamma,
                 .tau = config.tau,
                 .gradient_penalty = config.gradient_penalty,
                 .reward_bonus = config.reward_bonus}) {
    for (const int i : split.held_out) {
      for (int j = 0; j < job.dataset.obs_dim(); ++j) {
        held_out_states_.push_back(static_cast<float>(job.dataset.observations(i, j)));
      }
      for (int j = 0; j < act_dim_; ++j) {
        held_out_actions_.push_back(static_cast<float>(ToUnitAction(job.spec, job.dataset.actions(i, j), j)));
      }
    }
  }

  int64_t n_steps() const override { return n_steps_; }
  int64_t total() const override { return config_.behavior_steps + config_.n_steps; }

  void Step() override {
    if (n_steps_ < config_.behavior_steps) {
      StepBehavior();
    } else {
      all_.Draw(config_.batch_size, rng_, batch_);
      losses_ = update_.Step(batch_);
      ++n_steps_;
    }
  }

  std::vector<std::pair<std::string, double>> Losses() const override {
    if (n_steps_ <= config_.behavior_steps) {
      return {{"train/behavior_loss", behavior_loss_}, {"train/behavior_held_out_loss", best_}};
    }
    return {{"train/critic_loss", losses_.critic_loss}, {"train/actor_loss", losses_.actor_loss},
            {"train/mean_q", losses_.mean_q},           {"train/gradient_penalty", losses_.penalty},
            {"train/ent_coef", losses_.alpha},          {"train/behavior_held_out_loss", best_}};
  }
  std::unique_ptr<Policy> MakePolicy() const override { return std::make_unique<TanhGaussianPolicy>(update_.actor()); }

  void Save(NpzArrays& arrays) override {
    BehaviorState().Save(arrays);
    State().Save(arrays);
    arrays["counters"] = NpyArray(std::vector<int64_t>{n_steps_, stale_});
    arrays["losses"] = NpyArray(std::vector<double>{best_, behavior_loss_, losses_.critic_loss, losses_.actor_loss,
                                                    losses_.penalty, losses_.alpha, losses_.mean_q});
    arrays["rng"] = RngArray(rng_);
  }
  void Restore(const NpzArrays& arrays) override {
    BehaviorState().Restore(arrays);
    State().Restore(arrays);
    const auto& counters = CheckpointValues<int64_t>(arrays, "counters", 2);
    n_steps_ = counters[0];
    stale_ = counters[1];
    const auto& losses = CheckpointValues<double>(arrays, "losses", 7);
    best_ = losses[0];
    behavior_loss_ = losses[1];
    losses_ = {losses[2], losses[3], losses[4], losses[5], losses[6]};
    RestoreRng(arrays, "rng", rng_);
  }

 private:
  LearnedState BehaviorState() {
    LearnedState state("behavior/");
    behavior_.AddTo(state);
    return state;
  }
  /// The kept behaviour policy is part of it.
  LearnedState State() {
    LearnedState state("f_brc/");
    update_.AddTo(state);
    return state;
  }

  void StepBehavior() {
    const double share = static_cast<double>(n_steps_) / static_cast<double>(config_.behavior_steps);
    behavior_.set_learning_rate(config_.behavior_rate * (share < 0.8 ? 1 : share < 0.9 ? 0.1 : 0.01));
    train_.Draw(config_.batch_size, rng_, batch_);
    DrawMixtureNoise(config_.batch_size, act_dim_, rng_, noise_);
    behavior_loss_ = -behavior_.Step(batch_, noise_).log_density;
    ++n_steps_;
    if (n_steps_ % config_.check_interval != 0 && n_steps_ != config_.behavior_steps) return;
    const double loss = HeldOutLoss();
    if (loss < best_) {
      best_ = loss;
      stale_ = 0;
      update_.mixture() = behavior_.net();
    } else if (++stale_ >= config_.patience) {
      n_steps_ = config_.behavior_steps;
    }
  }

  /// Mean -log mu of the held-out actions.
  double HeldOutLoss() {
    const size_t n = held_out_actions_.size() / static_cast<size_t>(act_dim_);
    const float* out = pass_.Forward(behavior_.net(), held_out_states_.data(), static_cast<int>(n));
    std::vector<double> log_density;
    LogDensities({out, n * static_cast<size_t>(behavior_.net().out())}, held_out_actions_.data(),
                 static_cast<size_t>(act_dim_), act_dim_, log_density);
    double sum = 0;
    for (const double v : log_density) sum -= v;
    return sum / static_cast<double>(n);
  }

  FisherBrcConfig config_;
  int act_dim_;
  Rng rng_;
  OfflineRows all_, train_;
  AlignedVector<float> held_out_states_, held_out_actions_;
  MixtureUpdate behavior_;
  FisherBrcUpdate update_;
  int64_t n_steps_ = 0, stale_ = 0;
  double best_ = std::numeric_limits<double>::max(), behavior_loss_ = 0;
  OfflineBatch batch_;
  MixtureNoise noise_;
  FisherBrcLosses losses_;
  MlpPass pass_;
};

}  // namespace

std::unique_ptr<OfflineLearner> MakeFisherBrc(const OfflineJob& job, const FisherBrcConfig& config) {
  CheckHasRewards(job.dataset);
  const size_t obs_dim = static_cast<size_t>(job.spec.obs_dim());
  const Normalizer raw{std::vector<double>(obs_dim, 0.0), std::vector<double>(obs_dim, 1.0)};
  Rng rng = job.key.Stage("split").MakeRng();
  return std::make_unique<FisherBrcLearner>(job, config, raw, SplitCloneRows(job.dataset, config.held_out, rng),
                                            StartOf(job, config, raw));
}

}  // namespace oted
