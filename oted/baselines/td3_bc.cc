#include "oted/baselines/td3_bc.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "oted/base/sizes.h"
#include "oted/base/statistics.h"
#include "oted/rl/offline/offline_rows.h"
#include "oted/rl/offline/td3_update.h"
#include "oted/rl/training.h"

namespace oted {

void Td3Config::AddFields(FieldList& fields) {
  fields.Add("n_steps", &n_steps, "gradient steps of the critics", AtLeast(1));
  fields.Add("batch_size", &batch_size, "logged transitions per gradient step", BatchSizes());
  fields.Add("hidden", &hidden, "widths of the hidden layers of actor and critics", LayerWidths());
  fields.Add("learning_rate", &learning_rate, "Adam's step size", Above(0));
  fields.Add("gamma", &gamma, "discount factor", Between(0, 1));
  fields.Add("tau", &tau, "Polyak step of the target networks", AboveUpTo(0, 1));
  fields.Add("noise", &noise, "deviation of the target action's noise, for actions in [-1, 1]", AtLeast(0));
  fields.Add("noise_clip", &noise_clip, "largest size of that noise", AtLeast(0));
  fields.Add("policy_delay", &policy_delay, "steps of the critics for each step of the actor", AtLeast(1));
}

FieldList Td3BcConfig::Fields() {
  FieldList fields("td3_bc");
  AddFields(fields);
  fields.Add("alpha", &alpha, "weight of the value against the distance to the logged actions", Above(0));
  return fields;
}

RebracConfig::RebracConfig() {
  n_steps = 20'000;
  batch_size = 1024;
  hidden = {256, 256, 256};
  learning_rate = 1e-3;
}

FieldList RebracConfig::Fields() {
  FieldList fields("rebrac");
  AddFields(fields);
  fields.Add("actor_penalty", &actor_penalty, "weight of the distance to the logged actions in the actor's loss",
             AtLeast(0));
  fields.Add("critic_penalty", &critic_penalty, "the same of the next actions in the critics' target", AtLeast(0));
  return fields;
}

namespace {

template <class Net, class Pass>
class Td3Learner : public OfflineLearner {
 public:
  Td3Learner(OfflineRows rows, Td3Update<Net, Pass> update, const Td3Config& config, Rng rng)
      : rows_(std::move(rows)),
        update_(std::move(update)),
        total_(config.n_steps),
        batch_size_(config.batch_size),
        rng_(rng) {}

  int64_t n_steps() const override { return n_steps_; }
  int64_t total() const override { return total_; }
  void Step() override {
    rows_.Draw(batch_size_, rng_, batch_);
    losses_ = update_.Step(batch_);
    ++n_steps_;
  }
  std::vector<std::pair<std::string, double>> Losses() const override {
    return {{"train/critic_loss", losses_.critic_loss},
            {"train/actor_loss", losses_.actor_loss},
            {"train/mean_q", losses_.mean_q}};
  }
  std::unique_ptr<Policy> MakePolicy() const override { return std::make_unique<TanhGaussianPolicy>(update_.actor()); }
  void Save(NpzArrays& arrays) override {
    update_.Save(arrays);
    arrays["counters"] = NpyArray(std::vector<int64_t>{n_steps_});
    arrays["losses"] = NpyArray(std::vector<double>{losses_.critic_loss, losses_.actor_loss, losses_.mean_q});
    arrays["rng"] = RngArray(rng_);
  }
  void Restore(const NpzArrays& arrays) override {
    update_.Restore(arrays);
    n_steps_ = CheckpointValues<int64_t>(arrays, "counters", 1)[0];
    const auto& losses = CheckpointValues<double>(arrays, "losses", 3);
    losses_ = {losses[0], losses[1], losses[2]};
    RestoreRng(arrays, "rng", rng_);
  }

 private:
  OfflineRows rows_;
  Td3Update<Net, Pass> update_;
  int64_t total_, n_steps_ = 0;
  int batch_size_;
  Rng rng_;
  OfflineBatch batch_;
  Td3Losses losses_;
};

/// (s - mean) / (deviation + 0.001), as TD3+BC's authors do.
Normalizer AuthorsNormalizer(const Dataset& dataset) {
  Normalizer normalizer;
  for (int j = 0; j < dataset.obs_dim(); ++j) {
    std::vector<double> column;
    for (int i = 0; i < dataset.size(); ++i) column.push_back(dataset.observations(i, j));
    const double mean = Mean(column);
    double square = 0;
    for (const double v : column) square += (v - mean) * (v - mean);
    normalizer.mean.push_back(mean);
    normalizer.scale.push_back(std::sqrt(square / static_cast<double>(column.size())) + 1e-3);
  }
  return normalizer;
}

Td3Options Options(const Td3Config& config) {
  return {.learning_rate = config.learning_rate,
          .gamma = config.gamma,
          .tau = config.tau,
          .noise = config.noise,
          .noise_clip = config.noise_clip,
          .policy_delay = config.policy_delay};
}

/// ReBRAC's start: hidden biases of 0.1, and a last layer that is nearly zero.
void InitialiseAsRebrac(const std::vector<Mlp::Layer>& layers, AlignedVector<float>& parameters, double last,
                        Rng& rng) {
  for (size_t l = 0; l < layers.size(); ++l) {
    const Mlp::Layer& layer = layers[l];
    const bool is_last = l + 1 == layers.size();
    const double bound = is_last ? last : 1 / std::sqrt(static_cast<double>(layer.in));
    for (size_t i = layer.weight; i < layer.bias; ++i) parameters[i] = static_cast<float>(rng.Uniform(-bound, bound));
    for (size_t j = layer.bias; j < layer.bias + static_cast<size_t>(layer.out); ++j) {
      parameters[j] = is_last ? static_cast<float>(rng.Uniform(-last, last)) : 0.1f;
    }
  }
}

}  // namespace

std::unique_ptr<OfflineLearner> MakeTd3Bc(const OfflineJob& job, const Td3BcConfig& config) {
  const Normalizer normalizer = AuthorsNormalizer(job.dataset);
  OfflineRows rows(job.dataset, job.spec, normalizer, OfflineRowChoice::kAll);
  Rng rng = job.key.Stage("start").MakeRng();
  TanhGaussianPolicy actor(normalizer, config.hidden, job.spec.action_low, job.spec.action_high);
  actor.net().Initialize(rng);
  Mlp critics[2];
  for (Mlp& critic : critics) {
    critic = Mlp(job.spec.obs_dim() + job.spec.act_dim, config.hidden, 1);
    critic.Initialize(rng);
  }
  Td3Options options = Options(config);
  options.value_weight = config.alpha;
  options.actor_penalty = 1.0 / job.spec.act_dim;  // the authors' loss is a mean over the dimensions
  using Update = Td3Update<Mlp, MlpPass>;
  return std::make_unique<Td3Learner<Mlp, MlpPass>>(
      std::move(rows), Update(std::move(actor), std::move(critics[0]), std::move(critics[1]), options), config,
      job.key.Stage("training").MakeRng());
}

std::unique_ptr<OfflineLearner> MakeRebrac(const OfflineJob& job, const RebracConfig& config) {
  const size_t obs_dim = static_cast<size_t>(job.spec.obs_dim());
  const Normalizer raw{std::vector<double>(obs_dim, 0.0), std::vector<double>(obs_dim, 1.0)};
  OfflineRows rows(job.dataset, job.spec, raw, OfflineRowChoice::kWithNextAction);
  Rng rng = job.key.Stage("start").MakeRng();
  TanhGaussianPolicy actor(raw, config.hidden, job.spec.action_low, job.spec.action_high);
  InitialiseAsRebrac(actor.net().layers(), actor.net().parameters(), 1e-3, rng);
  LayerNormMlp critics[2];
  for (LayerNormMlp& critic : critics) {
    critic = LayerNormMlp(job.spec.obs_dim() + job.spec.act_dim, config.hidden, 1);
    critic.Initialize(rng);
    InitialiseAsRebrac(critic.layers(), critic.parameters(), 3e-3, rng);
  }
  Td3Options options = Options(config);
  options.value_weight = 1;
  options.actor_penalty = config.actor_penalty;
  options.critic_penalty = config.critic_penalty;
  options.smaller_critic = true;
  using Update = Td3Update<LayerNormMlp, LayerNormPass>;
  return std::make_unique<Td3Learner<LayerNormMlp, LayerNormPass>>(
      std::move(rows), Update(std::move(actor), std::move(critics[0]), std::move(critics[1]), options), config,
      job.key.Stage("training").MakeRng());
}

}  // namespace oted
