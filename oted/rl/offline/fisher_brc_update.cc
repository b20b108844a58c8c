#include "oted/rl/offline/fisher_brc_update.h"

#include <algorithm>
#include <utility>

namespace oted {
namespace {

std::span<const float> Rows(const float* values, size_t begin, size_t rows, int width) {
  return {values + begin * static_cast<size_t>(width), rows * static_cast<size_t>(width)};
}

}  // namespace

Mlp MixtureNet(int obs_dim, const std::vector<int>& hidden, int act_dim) {
  return {obs_dim, hidden, 3 * kMixtureComponents * act_dim};
}

void DrawMixtureNoise(int batch, int act_dim, Rng& rng, MixtureNoise& noise) {
  const size_t n = static_cast<size_t>(batch) * static_cast<size_t>(act_dim);
  noise.uniforms.resize(n);
  noise.normals.resize(n);
  for (double& v : noise.uniforms) v = rng.Uniform();
  for (double& v : noise.normals) v = rng.Normal();
}

MixtureUpdate::MixtureUpdate(Mlp net, double learning_rate)
    : act_dim_(net.out() / (3 * kMixtureComponents)),
      net_(std::move(net)),
      adam_(net_.n_parameters(), {.learning_rate = static_cast<float>(learning_rate)}),
      temperature_(1, -act_dim_, static_cast<float>(learning_rate), TemperatureLoss::kAlpha),
      gradient_(net_.n_parameters()) {}

MixtureLosses MixtureUpdate::Step(const OfflineBatch& batch, const MixtureNoise& noise) {
  const size_t n = static_cast<size_t>(batch.size), width = static_cast<size_t>(act_dim_),
               out_width = static_cast<size_t>(net_.out()), joint_width = batch.joint.size() / n;
  const float* out = pass_.Forward(net_, batch.observations.data(), batch.size);
  dout_.assign(n * out_width, 0.0f);
  MixtureLosses losses;
  losses.alpha = temperature_.alpha();
  const double share = 1.0 / static_cast<double>(n);
  ActionMixtureGradient gradient;
  for (size_t b = 0; b < n; ++b) {
    const std::span<float> dout(dout_.data() + b * out_width, out_width);
    for (int j = 0; j < act_dim_; ++j) {
      const size_t at = b * width + static_cast<size_t>(j);
      const ActionMixture mixture = MixtureOf(Rows(out, b, 1, net_.out()), j, act_dim_);
      const double logged = batch.joint[b * joint_width + joint_width - width + static_cast<size_t>(j)];
      losses.log_density += share * LogDensity(mixture, logged, &gradient);
      AddMixtureGradient(gradient, -share, j, act_dim_, dout);
      const MixtureDraw draw = Draw(mixture, noise.uniforms[at], noise.normals[at]);
      losses.entropy -= share * LogDensityOfDraw(mixture, draw, noise.normals[at], &gradient);
      AddMixtureGradient(gradient, losses.alpha * share, j, act_dim_, dout);
    }
  }
  pass_.Backward(net_, batch.observations.data(), dout_.data(), batch.size, {.parameters = gradient_.data()});
  adam_.Step(net_.parameters(), gradient_);
  temperature_.Step(-losses.entropy);
  return losses;
}

void MixtureUpdate::set_learning_rate(double learning_rate) {
  adam_.set_learning_rate(static_cast<float>(learning_rate));
  temperature_.set_learning_rate(static_cast<float>(learning_rate));
}

void MixtureUpdate::AddTo(LearnedState& state) {
  state.Add("mixture", net_.parameters(), adam_);
  temperature_.AddTo(state);
}

FisherBrcUpdate::FisherBrcUpdate(TanhGaussianPolicy actor, Mlp critic0, Mlp critic1, Mlp mixture,
                                 const FisherBrcOptions& options)
    : options_(options),
      actor_(std::move(actor)),
      critics_{std::move(critic0), std::move(critic1)},
      mixture_(std::move(mixture)),
      temperature_(1, -actor_.act_dim(), static_cast<float>(options.learning_rate), TemperatureLoss::kAlpha) {
  const Adam::Options adam{.learning_rate = static_cast<float>(options.learning_rate)};
  actor_adam_ = Adam(actor_.net().n_parameters(), adam);
  for (int i = 0; i < 2; ++i) {
    target_critics_[i] = critics_[i];
    critic_adam_[i] = Adam(critics_[i].n_parameters(), adam);
  }
  actor_gradient_.resize(actor_.net().n_parameters());
  critic_gradient_.resize(critics_[0].n_parameters());
}

FisherBrcLosses FisherBrcUpdate::Step(const OfflineBatch& batch) {
  Act(batch);
  Target(batch);
  FisherBrcLosses losses = StepCritics(batch);
  losses.alpha = temperature_.alpha();
  losses.actor_loss = StepActor(batch);
  temperature_.Step(actions_.MeanLogProb(batch.size));
  return losses;
}

/// a ~ pi at s and s', and mu's outputs there.
void FisherBrcUpdate::Act(const OfflineBatch& batch) {
  const int obs_dim = actor_.obs_dim(), n = batch.size;
  actor_out_ = actor_pass_.Forward(actor_.net(), batch.observations.data(), 2 * n);
  actions_.Forward(actor_out_, batch.noise.data(), 2 * n, actor_.act_dim());
  mixture_out_ = mixture_pass_.Forward(mixture_, batch.observations.data(), 2 * n);
  joint_pi_.resize(batch.joint.size());
  joint_next_.resize(batch.joint.size());
  actions_.Join(batch.observations.data(), obs_dim, 0, n, joint_pi_.data());
  actions_.Join(batch.observations.data() + static_cast<ptrdiff_t>(n) * obs_dim, obs_dim, n, n, joint_next_.data());
}

void FisherBrcUpdate::Target(const OfflineBatch& batch) {
  const size_t n = static_cast<size_t>(batch.size), act_dim = static_cast<size_t>(actor_.act_dim());
  LogDensities(Rows(mixture_out_, n, n, mixture_.out()), actions_.actions() + n * act_dim, act_dim, actor_.act_dim(),
               log_mu_);
  target_.resize(n);
  for (int i = 0; i < 2; ++i) {
    const float* offset = critic_pass_[0].Forward(target_critics_[i], joint_next_.data(), batch.size);
    for (size_t b = 0; b < n; ++b) target_[b] = i == 0 ? offset[b] : std::min<double>(target_[b], offset[b]);
  }
  for (size_t b = 0; b < n; ++b) {
    target_[b] = batch.rewards[b] + options_.reward_bonus +
                 options_.gamma * (1.0 - batch.terminated[b]) * (target_[b] + log_mu_[b]);
  }
}

FisherBrcLosses FisherBrcUpdate::StepCritics(const OfflineBatch& batch) {
  const size_t n = static_cast<size_t>(batch.size);
  const int obs_dim = actor_.obs_dim(), width = obs_dim + actor_.act_dim();
  LogDensities(Rows(mixture_out_, 0, n, mixture_.out()), batch.joint.data() + obs_dim, static_cast<size_t>(width),
               actor_.act_dim(), log_mu_logged_);
  FisherBrcLosses losses;
  dq_.resize(n);
  for (int i = 0; i < 2; ++i) {
    const float* offset = critic_pass_[0].Forward(critics_[i], batch.joint.data(), batch.size);
    for (size_t b = 0; b < n; ++b) {
      const double q = offset[b] + log_mu_logged_[b], error = q - target_[b];
      losses.critic_loss += error * error / static_cast<double>(n);
      losses.mean_q += 0.5 * q / static_cast<double>(n);
      dq_[b] = static_cast<float>(2 * error / static_cast<double>(n));
    }
    critic_pass_[0].Backward(critics_[i], batch.joint.data(), dq_.data(), batch.size,
                             {.parameters = critic_gradient_.data()});
    losses.penalty += penalty_.AddSquare(critics_[i], joint_pi_.data(), batch.size, {obs_dim, width},
                                         options_.gradient_penalty, critic_gradient_.data());
    critic_adam_[i].Step(critics_[i].parameters(), critic_gradient_, target_critics_[i].parameters(),
                         static_cast<float>(options_.tau));
  }
  return losses;
}

double FisherBrcUpdate::StepActor(const OfflineBatch& batch) {
  const size_t n = static_cast<size_t>(batch.size), act_dim = static_cast<size_t>(actor_.act_dim());
  const float alpha = temperature_.alpha();
  double loss = alpha * actions_.MeanLogProb(batch.size) + action_gradient_.Compute(critics_, critic_pass_,
                                                                                    joint_pi_.data(), actor_.obs_dim(),
                                                                                    actor_.act_dim(), batch.size);
  d_mu_.resize(n * act_dim);
  LogDensities(Rows(mixture_out_, 0, n, mixture_.out()), actions_.actions(), act_dim, actor_.act_dim(), log_mu_, d_mu_);
  da_.resize(n * act_dim);
  for (size_t b = 0; b < n; ++b) loss -= log_mu_[b] / static_cast<double>(n);
  for (size_t k = 0; k < da_.size(); ++k) {
    da_[k] = static_cast<float>(action_gradient_.dq_da()[k] - d_mu_[k] / static_cast<double>(n));
  }
  dout_.resize(n * 2 * act_dim);
  actions_.Backward(actor_out_, batch.noise.data(), da_.data(), alpha, batch.size, dout_.data());
  actor_pass_.Backward(actor_.net(), batch.observations.data(), dout_.data(), batch.size,
                       {.parameters = actor_gradient_.data()});
  actor_adam_.Step(actor_.net().parameters(), actor_gradient_);
  return loss;
}

void FisherBrcUpdate::AddTo(LearnedState& state) {
  state.Add("actor", actor_.net().parameters(), actor_adam_);
  state.Add("offset0", critics_[0].parameters(), critic_adam_[0]);
  state.Add("offset1", critics_[1].parameters(), critic_adam_[1]);
  temperature_.AddTo(state);
  state.Add("target0", target_critics_[0].parameters());
  state.Add("target1", target_critics_[1].parameters());
  state.Add("mu", mixture_.parameters());
}

}  // namespace oted
