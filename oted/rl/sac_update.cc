#include "oted/rl/sac_update.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/kernels.h"

namespace oted {
namespace {

constexpr float kHalfLog2Pi = 0.9189385332046727f;
constexpr float kSquashEpsilon = 1e-6f;  // inside log(1 - a^2 + eps), as in Stable-Baselines3

}  // namespace

SacUpdate::SacUpdate(TanhGaussianPolicy actor, const std::vector<int>& critic_hidden, const SacUpdateOptions& options,
                     Rng& rng)
    : options_(options), actor_(std::move(actor)) {
  const Adam::Options adam{.learning_rate = static_cast<float>(options.learning_rate)};
  for (int i = 0; i < 2; ++i) {
    critics_[i] = Mlp(actor_.obs_dim() + actor_.act_dim(), critic_hidden, 1);
    critics_[i].Initialize(rng);
    target_critics_[i] = critics_[i];
    critic_adam_[i] = Adam(critics_[i].n_parameters(), adam);
  }
  actor_adam_ = Adam(actor_.net().n_parameters(), adam);
  alpha_adam_ = Adam(1, adam);
  log_alpha_[0] = static_cast<float>(std::log(options.initial_alpha));
  actor_gradient_.resize(actor_.net().n_parameters());
  critic_gradient_.resize(critics_[0].n_parameters());
}

SacLosses SacUpdate::Step(const SacBatch& batch) {
  const float alpha = std::exp(log_alpha_[0]);
  ForwardActor(batch);

  // Temperature: the gradient of its loss with respect to log_alpha.
  double mean_log_prob = 0;
  for (int b = 0; b < batch.size; ++b) mean_log_prob += log_prob_[static_cast<size_t>(b)];
  mean_log_prob /= batch.size;
  const double alpha_loss = -log_alpha_[0] * (mean_log_prob + options_.target_entropy);
  const float alpha_gradient = static_cast<float>(-(mean_log_prob + options_.target_entropy));
  alpha_adam_.Step({log_alpha_.data(), 1}, {&alpha_gradient, 1});

  SacLosses losses = StepCritics(batch, alpha);
  losses.actor_loss = StepActor(batch, alpha) + alpha * mean_log_prob;
  losses.alpha = alpha;
  losses.alpha_loss = alpha_loss;
  for (int i = 0; i < 2; ++i) {
    kernels::Polyak(target_critics_[i].parameters().data(), critics_[i].parameters().data(),
                    static_cast<float>(options_.tau), critics_[i].n_parameters());
  }
  return losses;
}

/// a ~ pi(.|s) and a' ~ pi(.|s') with their log probabilities, in one pass over [s; s'].
void SacUpdate::ForwardActor(const SacBatch& batch) {
  const int obs_dim = actor_.obs_dim(), act_dim = actor_.act_dim(), rows = 2 * batch.size;
  actor_out_ = actor_pass_.Forward(actor_.net(), batch.observations.data(), rows);
  actions_.resize(static_cast<size_t>(rows * act_dim));
  std_.resize(actions_.size());
  log_prob_.resize(static_cast<size_t>(rows));
  joint_pi_.resize(batch.joint.size());
  joint_next_.resize(batch.joint.size());
  for (int b = 0; b < rows; ++b) {
    float log_prob = 0;
    const float* mean = actor_out_ + static_cast<ptrdiff_t>(b) * 2 * act_dim;
    const size_t offset = static_cast<size_t>(b * act_dim);
    for (int j = 0; j < act_dim; ++j) {
      const float log_std = std::clamp(mean[act_dim + j], kLogStdMin, kLogStdMax);
      const float std = std::exp(log_std);
      const float noise = batch.noise[offset + static_cast<size_t>(j)];
      const float action = std::tanh(mean[j] + std * noise);
      std_[offset + static_cast<size_t>(j)] = std;
      actions_[offset + static_cast<size_t>(j)] = action;
      log_prob += -0.5f * noise * noise - log_std - kHalfLog2Pi - std::log(1.0f - action * action + kSquashEpsilon);
    }
    log_prob_[static_cast<size_t>(b)] = log_prob;
    float* joint = b < batch.size ? joint_pi_.data() + static_cast<ptrdiff_t>(b) * (obs_dim + act_dim)
                                  : joint_next_.data() + static_cast<ptrdiff_t>(b - batch.size) * (obs_dim + act_dim);
    std::copy_n(batch.observations.data() + static_cast<ptrdiff_t>(b) * obs_dim, obs_dim, joint);
    std::copy_n(actions_.data() + offset, act_dim, joint + obs_dim);
  }
}

SacLosses SacUpdate::StepCritics(const SacBatch& batch, float alpha) {
  const size_t n = static_cast<size_t>(batch.size);
  target_.resize(n);
  dq_.resize(n);

  // y = r + gamma (1 - terminated) (min_i Q'_i(s', a') - alpha log pi(a'|s'))
  for (int i = 0; i < 2; ++i) {
    const float* q = target_pass_.Forward(target_critics_[i], joint_next_.data(), batch.size);
    for (size_t b = 0; b < n; ++b) target_[b] = i == 0 ? q[b] : std::min(target_[b], q[b]);
  }
  const float gamma = static_cast<float>(options_.gamma);
  for (size_t b = 0; b < n; ++b) {
    target_[b] = batch.rewards[b] + gamma * (1.0f - batch.terminated[b]) * (target_[b] - alpha * log_prob_[n + b]);
  }

  SacLosses losses;
  for (int i = 0; i < 2; ++i) {
    const float* q = critic_pass_[i].Forward(critics_[i], batch.joint.data(), batch.size);
    for (size_t b = 0; b < n; ++b) {
      const float error = q[b] - target_[b];
      losses.critic_loss += 0.5 * error * error / static_cast<double>(n);
      losses.mean_q += 0.5 * q[b] / static_cast<double>(n);
      dq_[b] = error / static_cast<float>(n);
    }
    critic_pass_[i].Backward(critics_[i], batch.joint.data(), dq_.data(), batch.size, critic_gradient_.data(), nullptr);
    critic_adam_[i].Step({critics_[i].parameters().data(), critics_[i].n_parameters()},
                         {critic_gradient_.data(), critic_gradient_.size()});
  }
  return losses;
}

/// Returns mean -min_i Q_i(s, a), the critics' part of the actor's loss.
double SacUpdate::StepActor(const SacBatch& batch, float alpha) {
  const int obs_dim = actor_.obs_dim(), act_dim = actor_.act_dim();
  const size_t n = static_cast<size_t>(batch.size), width = static_cast<size_t>(act_dim);
  const float* q[2];
  for (int i = 0; i < 2; ++i) q[i] = critic_pass_[i].Forward(critics_[i], joint_pi_.data(), batch.size);

  // The gradient runs through the smaller critic of each row; no critic needs its own weights' gradient here.
  double loss = 0;
  for (size_t b = 0; b < n; ++b) loss -= std::min(q[0][b], q[1][b]) / static_cast<double>(n);
  const float scale = -1.0f / static_cast<float>(n);
  std::vector<bool> first(n);
  for (size_t b = 0; b < n; ++b) first[b] = q[0][b] <= q[1][b];
  for (int i = 0; i < 2; ++i) {
    for (size_t b = 0; b < n; ++b) dq_[b] = first[b] == (i == 0) ? scale : 0.0f;
    dq_da_[i].resize(n * width);
    critic_pass_[i].Backward(critics_[i], joint_pi_.data(), dq_.data(), batch.size, nullptr, dq_da_[i].data(),
                             {obs_dim, obs_dim + act_dim});
  }

  // The actor's activations at s are still those of ForwardActor: its parameters have not moved since.
  actor_dout_.resize(n * 2 * width);
  const float alpha_over_n = alpha / static_cast<float>(n);
  for (size_t b = 0; b < n; ++b) {
    for (size_t j = 0; j < width; ++j) {
      const size_t at = b * width + j;
      const float action = actions_[at], one_minus = 1.0f - action * action;
      // d/du of alpha log pi: only the squashing term depends on u once the noise is fixed.
      const float du = (dq_da_[0][at] + dq_da_[1][at]) * one_minus +
                       alpha_over_n * 2.0f * action * one_minus / (one_minus + kSquashEpsilon);
      const float log_std = actor_out_[b * 2 * width + width + j];
      const bool inside = log_std >= kLogStdMin && log_std <= kLogStdMax;
      actor_dout_[b * 2 * width + j] = du;
      actor_dout_[b * 2 * width + width + j] = inside ? du * std_[at] * batch.noise[at] - alpha_over_n : 0.0f;
    }
  }
  actor_pass_.Backward(actor_.net(), batch.observations.data(), actor_dout_.data(), batch.size, actor_gradient_.data(),
                       nullptr);
  actor_adam_.Step({actor_.net().parameters().data(), actor_gradient_.size()},
                   {actor_gradient_.data(), actor_gradient_.size()});
  return loss;
}

namespace {

template <class Visit>
void VisitState(const char* name, AlignedVector<float>& parameters, Adam& adam, const Visit& visit) {
  const std::string prefix = std::string("sac/") + name;
  visit(prefix + "/parameters", parameters);
  visit(prefix + "/m", adam.m());
  visit(prefix + "/v", adam.v());
}

}  // namespace

void SacUpdate::Save(NpzArrays& arrays) {
  const auto save = [&](const std::string& name, AlignedVector<float>& values) {
    arrays[name] = NpyArray(std::vector<float>(values.begin(), values.end()));
  };
  VisitState("actor", actor_.net().parameters(), actor_adam_, save);
  VisitState("critic0", critics_[0].parameters(), critic_adam_[0], save);
  VisitState("critic1", critics_[1].parameters(), critic_adam_[1], save);
  VisitState("alpha", log_alpha_, alpha_adam_, save);
  save("sac/target0", target_critics_[0].parameters());
  save("sac/target1", target_critics_[1].parameters());
  arrays["sac/n_steps"] = NpyArray(std::vector<int64_t>{alpha_adam_.n_steps()});
}

void SacUpdate::Restore(const NpzArrays& arrays) {
  const auto restore = [&](const std::string& name, auto& values) {
    const auto found = arrays.find(name);
    if (found == arrays.end() || found->second.size() != static_cast<int64_t>(values.size())) {
      throw DataError("no fitting array '" + name + "'");
    }
    const std::vector<double> stored = found->second.ToDouble();
    using Value = std::decay_t<decltype(values[0])>;
    std::transform(stored.begin(), stored.end(), values.begin(), [](double v) { return static_cast<Value>(v); });
  };
  VisitState("actor", actor_.net().parameters(), actor_adam_, restore);
  VisitState("critic0", critics_[0].parameters(), critic_adam_[0], restore);
  VisitState("critic1", critics_[1].parameters(), critic_adam_[1], restore);
  VisitState("alpha", log_alpha_, alpha_adam_, restore);
  restore("sac/target0", target_critics_[0].parameters());
  restore("sac/target1", target_critics_[1].parameters());
  std::vector<int64_t> n_steps(1);
  restore("sac/n_steps", n_steps);
  for (Adam* adam : {&actor_adam_, &critic_adam_[0], &critic_adam_[1], &alpha_adam_}) adam->n_steps() = n_steps[0];
}

}  // namespace oted
