#include "oted/rl/value_dice_update.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/gemm.h"
#include "oted/nn/kernels.h"
#include "oted/nn/kernels_math.h"

namespace oted {
namespace {

// exp(-5) < 0.01 of the action's half range; the authors' bounds too.
constexpr float kLogStdFloor = -5.0f;

}  // namespace

void DrawValueDiceBatch(const ImitationRows& logged, const std::deque<ImitationRows>* replay, int size,
                        const TanhGaussianPolicy& policy, Rng& rng, ValueDiceBatch& batch) {
  const size_t n = static_cast<size_t>(size), obs_dim = static_cast<size_t>(policy.obs_dim()),
               act_dim = static_cast<size_t>(policy.act_dim()), n_replay = replay != nullptr ? n : 0;
  batch.size = size;
  batch.has_replay = replay != nullptr;
  batch.observations.resize((2 * n + n_replay) * obs_dim);
  batch.joint.resize((n + n_replay) * (obs_dim + act_dim));
  batch.noise.resize((2 * n + n_replay) * act_dim);
  batch.mix.resize(n);
  for (size_t b = 0; b < n + n_replay; ++b) {
    const ImitationRows& from = b < n ? logged : (*replay)[rng.Below(replay->size())];
    const int row = static_cast<int>(rng.Below(static_cast<uint64_t>(from.size())));
    float* joint = batch.joint.data() + b * (obs_dim + act_dim);
    std::copy_n(from.state(row), obs_dim, joint);
    std::copy_n(from.action(row), act_dim, joint + obs_dim);
    if (b < n) std::copy_n(from.state(row), obs_dim, batch.observations.data() + b * obs_dim);
    std::copy_n(from.Next(row, rng), obs_dim, batch.observations.data() + (n + b) * obs_dim);
  }
  rng.FillNormal({batch.noise.data(), batch.noise.size()});
  for (float& share : batch.mix) share = static_cast<float>(rng.Uniform());
}

ValueDiceUpdate::ValueDiceUpdate(TanhGaussianPolicy actor, const std::vector<int>& critic_hidden,
                                 const ValueDiceOptions& options, Rng& rng)
    : options_(options), actor_(std::move(actor)), critic_(actor_.obs_dim() + actor_.act_dim(), critic_hidden, 1) {
  critic_.Initialize(rng);
  actor_adam_ = Adam(actor_.net().n_parameters(), {.learning_rate = static_cast<float>(options.actor_learning_rate)});
  critic_adam_ = Adam(critic_.n_parameters(), {.learning_rate = static_cast<float>(options.critic_learning_rate)});
  actor_gradient_.resize(actor_.net().n_parameters());
  critic_gradient_.resize(critic_.n_parameters());
}

ValueDiceLosses ValueDiceUpdate::Step(const ValueDiceBatch& batch, bool moves_actor) {
  OTED_CHECK(batch.size > 0);
  Act(batch);
  ValueDiceLosses losses;
  losses.objective = ObjectiveGradient(batch);
  losses.penalty = AddGradientPenalty(batch);
  critic_adam_.Step(critic_.parameters(), critic_gradient_);
  if (moves_actor) losses.orthogonality = StepActor(batch);
  return losses;
}

/// Fills pairs_: a ~ pi at all observations.
void ValueDiceUpdate::Act(const ValueDiceBatch& batch) {
  const size_t obs_dim = static_cast<size_t>(actor_.obs_dim()), act_dim = static_cast<size_t>(actor_.act_dim());
  const size_t rows = batch.observations.size() / obs_dim, width = obs_dim + act_dim;
  actor_out_ = actor_pass_.Forward(actor_.net(), batch.observations.data(), static_cast<int>(rows));
  std_.resize(rows * act_dim);
  product_.resize(rows * act_dim);
  for (size_t b = 0; b < rows; ++b) {
    const float* log_std = actor_out_ + 2 * b * act_dim + act_dim;
    for (size_t j = 0; j < act_dim; ++j) std_[b * act_dim + j] = std::clamp(log_std[j], kLogStdFloor, kLogStdMax);
  }
  kernels::Exp(std_.data(), std_.data(), std_.size());
  for (size_t b = 0; b < rows; ++b) {
    for (size_t j = 0, at = b * act_dim; j < act_dim; ++j, ++at) {
      product_[at] = actor_out_[2 * b * act_dim + j] + std_[at] * batch.noise[at];
    }
  }
  kernels::Tanh(product_.data(), product_.data(), product_.size());
  pairs_.resize(batch.joint.size() + rows * width);
  std::copy(batch.joint.begin(), batch.joint.end(), pairs_.begin());
  float* pair = pairs_.data() + batch.joint.size();
  for (size_t b = 0; b < rows; ++b, pair += width) {
    std::copy_n(batch.observations.data() + b * obs_dim, obs_dim, pair);
    std::copy_n(product_.data() + b * act_dim, act_dim, pair + obs_dim);
  }
}

/// J, and its gradients in critic_gradient_ and da_.
double ValueDiceUpdate::ObjectiveGradient(const ValueDiceBatch& batch) {
  const int obs_dim = actor_.obs_dim(), width = obs_dim + actor_.act_dim();
  const size_t n = static_cast<size_t>(batch.size), n_joint = batch.has_replay ? 2 * n : n;
  const size_t n_pairs = pairs_.size() / static_cast<size_t>(width);
  const float* nu = critic_pass_.Forward(critic_, pairs_.data(), static_cast<int>(n_pairs));
  // After the joint rows: logged states, then the successors of the joint rows in their order.
  const float *nu_start = nu + n_joint, *nu_next = nu_start + n;
  const double gamma = options_.gamma, alpha = batch.has_replay ? options_.replay_share : 0.0;
  const auto share = [&](size_t i) { return (i < n ? 1 - alpha : alpha) / static_cast<double>(n); };
  std::vector<double> x(n_joint);
  double largest = -INFINITY, sum = 0, linear = 0;
  for (size_t i = 0; i < n_joint; ++i) {
    x[i] = nu[i] - gamma * nu_next[i];
    largest = std::max(largest, x[i]);
    if (i >= n) linear += share(i) * x[i];
  }
  for (size_t i = 0; i < n_joint; ++i) sum += share(i) * std::exp(x[i] - largest);
  dnu_.resize(n_pairs);
  const double of_start = (1 - alpha) * (1 - gamma) / static_cast<double>(n);
  for (size_t i = 0; i < n_joint; ++i) {
    double d = share(i) * std::exp(x[i] - largest) / sum;
    if (i >= n) d -= share(i);
    dnu_[i] = static_cast<float>(d);
    dnu_[n_joint + n + i] = static_cast<float>(-gamma * d);
    if (i >= n) continue;
    linear += of_start * nu_start[i];
    dnu_[n_joint + i] = static_cast<float>(-of_start);
  }
  da_.resize(n_pairs * static_cast<size_t>(actor_.act_dim()));
  critic_pass_.Backward(critic_, pairs_.data(), dnu_.data(), static_cast<int>(n_pairs),
                        {critic_gradient_.data(), da_.data(), {obs_dim, width}});
  // J does not depend on a constant in nu. What rounding leaves of its derivative, Adam would blow up to a full step.
  critic_gradient_[critic_.layers().back().bias] = 0;
  return largest + std::log(sum) - linear;
}

/// Between logged pairs and, by turns, [s, a~pi] and [s', a'~pi]; with a replay, its pairs in place of the former.
double ValueDiceUpdate::AddGradientPenalty(const ValueDiceBatch& batch) {
  if (options_.gradient_penalty == 0) return 0;
  const size_t n = static_cast<size_t>(batch.size), width = static_cast<size_t>(critic_.in());
  between_.resize(n * width);
  for (size_t b = 0; b < n; ++b) {
    const float *logged = pairs_.data() + b * width, share = batch.mix[b];
    // Rows n and on: the replay's [s, a] where there is one, otherwise [s, a~pi]. [s', a'~pi] of the logs come n later.
    const float* other = pairs_.data() + ((b % 2 == 0 ? n : (batch.has_replay ? 3 * n : 2 * n)) + b) * width;
    for (size_t j = 0; j < width; ++j) between_[b * width + j] = share * logged[j] + (1 - share) * other[j];
  }
  return penalty_.Add(critic_, between_.data(), batch.size, options_.gradient_penalty, critic_gradient_.data());
}

double ValueDiceUpdate::StepActor(const ValueDiceBatch& batch) {
  const size_t obs_dim = static_cast<size_t>(actor_.obs_dim()), act_dim = static_cast<size_t>(actor_.act_dim());
  const size_t rows = batch.observations.size() / obs_dim, n_joint = batch.joint.size() / (obs_dim + act_dim);
  const float* da = da_.data() + n_joint * act_dim;
  actor_dout_.resize(rows * 2 * act_dim);
  for (size_t b = 0; b < rows; ++b) {
    const float* out = actor_out_ + 2 * b * act_dim;
    const float* action = pairs_.data() + (n_joint + b) * (obs_dim + act_dim) + obs_dim;
    for (size_t j = 0; j < act_dim; ++j) {
      const size_t at = b * act_dim + j;
      const float du = -da[at] * (1.0f - action[j] * action[j]);  // of -J, which the actor minimises
      const bool inside = out[act_dim + j] >= kLogStdFloor && out[act_dim + j] <= kLogStdMax;
      actor_dout_[2 * b * act_dim + j] = du;
      actor_dout_[2 * b * act_dim + act_dim + j] = inside ? du * std_[at] * batch.noise[at] : 0.0f;
    }
  }
  actor_pass_.Backward(actor_.net(), batch.observations.data(), actor_dout_.data(), static_cast<int>(rows),
                       {.parameters = actor_gradient_.data()});
  const double orthogonality = AddOrthogonality();
  actor_adam_.Step(actor_.net().parameters(), actor_gradient_);
  return orthogonality;
}

/// sum_l |offdiag(W_l^T W_l)|^2, whose gradient is 4 W_l offdiag(W_l^T W_l).
double ValueDiceUpdate::AddOrthogonality() {
  if (options_.orthogonal == 0) return 0;
  const kernels::FlushDenormals flush;
  double sum = 0;
  for (const Mlp::Layer& layer : actor_.net().layers()) {
    const float* w = actor_.net().parameters().data() + layer.weight;
    const size_t n = static_cast<size_t>(layer.out);
    gram_.resize(n * n);
    Gemm(Op::kTranspose, Op::kNone, layer.out, layer.out, layer.in, w, layer.out, w, layer.out, 0.0f, gram_.data(),
         layer.out);
    for (size_t i = 0; i < n; ++i) gram_[i * n + i] = 0;
    for (const float v : gram_) sum += static_cast<double>(v) * v;
    product_.resize(std::max(product_.size(), static_cast<size_t>(layer.in) * n));
    Gemm(Op::kNone, Op::kNone, layer.in, layer.out, layer.out, w, layer.out, gram_.data(), layer.out, 0.0f,
         product_.data(), layer.out);
    const float factor = static_cast<float>(4 * options_.orthogonal);
    float* gradient = actor_gradient_.data() + layer.weight;
    for (size_t k = 0; k < static_cast<size_t>(layer.in) * n; ++k) gradient[k] += factor * product_[k];
  }
  return sum;
}

LearnedState ValueDiceUpdate::State() {
  LearnedState state("valuedice/");
  state.Add("actor", actor_.net().parameters(), actor_adam_);
  state.Add("critic", critic_.parameters(), critic_adam_);
  return state;
}

void ValueDiceUpdate::Restore(const NpzArrays& arrays, const std::string& where) {
  try {
    State().Restore(arrays);
  } catch (const DataError& error) {
    throw DataError("'" + where + "' has " + error.what() + "; remove it to make it again");
  }
}

}  // namespace oted
