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
  return losses;
}

/// a ~ pi(.|s) and a' ~ pi(.|s') with their log probabilities, in one pass over [s; s'].
void SacUpdate::ForwardActor(const SacBatch& batch) {
  const int obs_dim = actor_.obs_dim(), act_dim = actor_.act_dim(), rows = 2 * batch.size;
  actor_out_ = actor_pass_.Forward(actor_.net(), batch.observations.data(), rows);
  const size_t width = static_cast<size_t>(act_dim), n = static_cast<size_t>(rows) * width;
  for (AlignedVector<float>* values : {&actions_, &log_std_, &std_, &log_slope_}) values->resize(n);
  log_prob_.resize(static_cast<size_t>(rows));
  joint_pi_.resize(batch.joint.size());
  joint_next_.resize(batch.joint.size());
  // Element-wise functions on whole arrays: the vector versions take eight or sixteen elements at a time.
  for (size_t b = 0; b < static_cast<size_t>(rows); ++b) {
    const float* log_std = actor_out_ + 2 * b * width + width;
    for (size_t j = 0; j < width; ++j) log_std_[b * width + j] = std::clamp(log_std[j], kLogStdMin, kLogStdMax);
  }
  kernels::Exp(log_std_.data(), std_.data(), n);
  for (size_t b = 0; b < static_cast<size_t>(rows); ++b) {
    const float* mean = actor_out_ + 2 * b * width;
    for (size_t j = 0, at = b * width; j < width; ++j, ++at) actions_[at] = mean[j] + std_[at] * batch.noise[at];
  }
  kernels::Tanh(actions_.data(), actions_.data(), n);
  for (size_t i = 0; i < n; ++i) log_slope_[i] = 1.0f - actions_[i] * actions_[i] + kSquashEpsilon;
  kernels::Log(log_slope_.data(), log_slope_.data(), n);
  for (int b = 0; b < rows; ++b) {
    const size_t offset = static_cast<size_t>(b) * width;
    float log_prob = 0;
    for (size_t at = offset; at < offset + width; ++at) {
      const float noise = batch.noise[at];
      log_prob += -0.5f * noise * noise - log_std_[at] - kHalfLog2Pi - log_slope_[at];
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
    const float* q = critic_pass_[0].Forward(target_critics_[i], joint_next_.data(), batch.size);
    for (size_t b = 0; b < n; ++b) target_[b] = i == 0 ? q[b] : std::min(target_[b], q[b]);
  }
  const float gamma = static_cast<float>(options_.gamma);
  for (size_t b = 0; b < n; ++b) {
    target_[b] = batch.rewards[b] + gamma * (1.0f - batch.terminated[b]) * (target_[b] - alpha * log_prob_[n + b]);
  }

  SacLosses losses;
  for (int i = 0; i < 2; ++i) {
    const float* q = critic_pass_[0].Forward(critics_[i], batch.joint.data(), batch.size);
    for (size_t b = 0; b < n; ++b) {
      const float error = q[b] - target_[b];
      losses.critic_loss += 0.5 * error * error / static_cast<double>(n);
      losses.mean_q += 0.5 * q[b] / static_cast<double>(n);
      dq_[b] = error / static_cast<float>(n);
    }
    critic_pass_[0].Backward(critics_[i], batch.joint.data(), dq_.data(), batch.size, critic_gradient_.data(), nullptr);
    // The targets follow at once: nothing below reads them in this step, and the critics are in the cache.
    critic_adam_[i].Step(critics_[i].parameters(), critic_gradient_, target_critics_[i].parameters(),
                         static_cast<float>(options_.tau));
  }
  return losses;
}

/// Returns mean -min_i Q_i(s, a), the critics' part of the actor's loss.
double SacUpdate::StepActor(const SacBatch& batch, float alpha) {
  const int obs_dim = actor_.obs_dim(), act_dim = actor_.act_dim();
  const size_t n = static_cast<size_t>(batch.size), width = static_cast<size_t>(act_dim);
  const float* q[2];
  for (int i = 0; i < 2; ++i) q[i] = critic_pass_[i].Forward(critics_[i], joint_pi_.data(), batch.size);

  // The gradient runs through the smaller critic of each row, so only its rows go back through a critic; no critic
  // needs its own weights' gradient here.
  double loss = 0;
  for (std::vector<int>& rows : smaller_) rows.clear();
  for (size_t b = 0; b < n; ++b) {
    loss -= std::min(q[0][b], q[1][b]) / static_cast<double>(n);
    smaller_[q[0][b] <= q[1][b] ? 0 : 1].push_back(static_cast<int>(b));
  }
  dq_.assign(n, -1.0f / static_cast<float>(n));
  dq_da_.resize(n * width);
  dq_da_rows_.resize(n * width);
  for (int i = 0; i < 2; ++i) {
    critic_pass_[i].BackwardRows(critics_[i], smaller_[i], dq_.data(), dq_da_rows_.data(),
                                 {obs_dim, obs_dim + act_dim});
    const float* from = dq_da_rows_.data();
    for (const int row : smaller_[i]) {
      std::copy_n(from, width, dq_da_.data() + static_cast<size_t>(row) * width);
      from += width;
    }
  }

  // The actor's activations at s are still those of ForwardActor: its parameters have not moved since.
  actor_dout_.resize(n * 2 * width);
  const float alpha_over_n = alpha / static_cast<float>(n);
  for (size_t b = 0; b < n; ++b) {
    for (size_t j = 0; j < width; ++j) {
      const size_t at = b * width + j;
      const float action = actions_[at], one_minus = 1.0f - action * action;
      // d/du of alpha log pi: only the squashing term depends on u once the noise is fixed.
      const float du = dq_da_[at] * one_minus + alpha_over_n * 2.0f * action * one_minus / (one_minus + kSquashEpsilon);
      const float log_std = actor_out_[b * 2 * width + width + j];
      const bool inside = log_std >= kLogStdMin && log_std <= kLogStdMax;
      actor_dout_[b * 2 * width + j] = du;
      actor_dout_[b * 2 * width + width + j] = inside ? du * std_[at] * batch.noise[at] - alpha_over_n : 0.0f;
    }
  }
  actor_pass_.Backward(actor_.net(), batch.observations.data(), actor_dout_.data(), batch.size, actor_gradient_.data(),
                       nullptr);
  actor_adam_.Step(actor_.net().parameters(), actor_gradient_);
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
