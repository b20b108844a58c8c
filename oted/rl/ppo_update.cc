#include "oted/rl/ppo_update.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/categorical.h"

namespace oted {
namespace {

constexpr float kBound = 10;           // quantities in spreads, as VecNormalize of Stable-Baselines3 cuts them
constexpr float kHeadScale = 0.01f;    // of the policy's first logits
constexpr float kAdamEpsilon = 1e-5f;  // Stable-Baselines3's for PPO

/// Makes the last layer small: its weight and bias are the end of the flat vector.
void ScaleHead(FeatureNet& net, float factor) {
  const auto first = net.parameters().begin() + static_cast<ptrdiff_t>(net.layers().back().weight);
  std::for_each(first, net.parameters().end(), [&](float& p) { p *= factor; });
}

}  // namespace

PpoUpdate::PpoUpdate(const Encoder& encoder, const NetSize& size, int n_actions, const PpoUpdateOptions& options,
                     Rng& rng)
    : options_(options),
      policy_(FeatureNet(encoder, size, n_actions, kBound)),
      critic_(encoder, size, 1, kBound),
      actor_part_(MakePart(policy_.net())),
      critic_part_(MakePart(critic_)) {
  actor().Initialize(rng);
  critic().Initialize(rng);
  ScaleHead(actor(), kHeadScale);
}

PpoUpdate::Part PpoUpdate::MakePart(FeatureNet& net) const {
  Part part;
  part.net = &net;
  part.adam =
      Adam(net.n_parameters(), {.learning_rate = static_cast<float>(options_.learning_rate), .epsilon = kAdamEpsilon});
  part.gradient.resize(net.n_parameters());
  return part;
}

void PpoUpdate::Forward(Part& part, std::span<const double> observations, int n) {
  const size_t obs_dim = static_cast<size_t>(part.net->in());
  OTED_CHECK(n > 0 && observations.size() == static_cast<size_t>(n) * obs_dim);
  part.pass.Reserve(*part.net, n);
  for (int i = 0; i < n; ++i) {
    part.pass.Encode(*part.net, observations.subspan(static_cast<size_t>(i) * obs_dim, obs_dim), i);
  }
  part.out = part.pass.Forward(*part.net);
}

void PpoUpdate::Evaluate(std::span<const double> observations, int n, std::span<float> logits,
                         std::span<float> values) {
  Forward(actor_part_, observations, n);
  std::copy_n(actor_part_.out, logits.size(), logits.begin());
  EvaluateValues(observations, n, values);
}

void PpoUpdate::EvaluateValues(std::span<const double> observations, int n, std::span<float> values) {
  OTED_CHECK(values.size() == static_cast<size_t>(n));
  Forward(critic_part_, observations, n);
  std::copy_n(critic_part_.out, values.size(), values.begin());
}

PpoLosses PpoUpdate::Step(const PpoBatch& batch) {
  const int n = batch.size();
  for (Part* part : {&actor_part_, &critic_part_}) {
    Forward(*part, batch.observations.values(), n);
    part->dout.resize(static_cast<size_t>(n * part->net->out()));
  }
  const size_t rows = static_cast<size_t>(n), k = static_cast<size_t>(policy_.n_actions());
  const double per_row = 1.0 / n;
  PpoLosses losses;
  std::vector<float> log_p(k);
  for (size_t i = 0; i < rows; ++i) {
    LogSoftmax({actor_part_.out + i * k, k}, policy_.n_actions(), log_p);
    const size_t action = static_cast<size_t>(batch.actions[i]);
    OTED_CHECK(action < k);
    const double advantage = static_cast<double>(batch.advantages[i]);
    const double log_ratio = static_cast<double>(log_p[action]) - static_cast<double>(batch.log_probs[i]);
    const double ratio = std::exp(log_ratio);
    const double clipped = std::clamp(ratio, 1 - options_.clip_range, 1 + options_.clip_range);
    losses.policy_loss -= std::min(ratio * advantage, clipped * advantage) * per_row;
    losses.approx_kl += (ratio - 1 - log_ratio) * per_row;
    losses.clip_fraction += (ratio != clipped ? 1 : 0) * per_row;
    // Where the clipped term is the smaller one the loss does not depend on the ratio.
    const double d_log_p = ratio * advantage <= clipped * advantage ? -ratio * advantage * per_row : 0.0;

    double entropy = 0;
    for (const float lp : log_p) entropy -= std::exp(static_cast<double>(lp)) * static_cast<double>(lp);
    losses.entropy += entropy * per_row;
    float* dlogits = actor_part_.dout.data() + i * k;
    for (size_t a = 0; a < k; ++a) {
      const double lp = static_cast<double>(log_p[a]), p = std::exp(lp);
      dlogits[a] = static_cast<float>(d_log_p * ((a == action ? 1.0 : 0.0) - p) +
                                      options_.ent_coef * per_row * p * (lp + entropy));
    }
    const double error = static_cast<double>(critic_part_.out[i]) - static_cast<double>(batch.returns[i]);
    losses.value_loss += error * error * per_row;
    critic_part_.dout[i] = static_cast<float>(options_.vf_coef * 2 * error * per_row);
  }

  double square = 0;
  for (Part* part : {&actor_part_, &critic_part_}) {
    part->pass.Backward(*part->net, part->dout.data(), part->gradient.data());
    for (const float g : part->gradient) square += static_cast<double>(g) * static_cast<double>(g);
  }
  losses.gradient_norm = std::sqrt(square);
  const auto shorten = static_cast<float>(std::min(1.0, options_.max_grad_norm / (losses.gradient_norm + 1e-6)));
  for (Part* part : {&actor_part_, &critic_part_}) {
    for (float& g : part->gradient) g *= shorten;
    part->adam.Step(part->net->parameters(), part->gradient);
  }
  return losses;
}

LearnedState PpoUpdate::State() {
  LearnedState state("ppo/");
  state.Add("actor", actor_part_.net->parameters(), actor_part_.adam);
  state.Add("critic", critic_part_.net->parameters(), critic_part_.adam);
  return state;
}

}  // namespace oted
