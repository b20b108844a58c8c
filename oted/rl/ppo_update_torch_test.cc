#include <gtest/gtest.h>

#include "oted/nn/torch_testing.h"
#include "oted/rl/ppo_update.h"

namespace oted::ppo_update_torch_test {

constexpr int kBatch = 48, kActions = 3;
constexpr double kTolerance = 1e-5;

/// Vectors of quantities, or images of indices with a direction: what a network of the update looks at.
struct Task {
  const char* name;
  InputShape shape;
  int obs_dim;
  NetSize size;
};

const Task kVector = {"vector", {}, 5, {{16, 8}, {}, false}};
const Task kImage = {"image", {{5, 5, 2}, {}}, 51, {{16}, {4, 6}, false}};

Task WithLevels(Task task) {
  if (task.shape.image.empty()) return task;
  for (int i = 0; i < 25; ++i) task.shape.levels.insert(task.shape.levels.end(), {4, 3});
  task.shape.levels.push_back(4);
  return task;
}

std::vector<double> RandomRow(const Task& task, Rng& rng) {
  std::vector<double> row(static_cast<size_t>(task.obs_dim));
  for (size_t i = 0; i < row.size(); ++i) {
    row[i] = task.shape.levels.empty() ? 3 * rng.Normal() + 1
                                       : static_cast<double>(rng.Below(static_cast<uint64_t>(task.shape.levels[i])));
  }
  return row;
}

Array2<double> RandomRows(const Task& task, int n, Rng& rng) {
  Array2<double> rows;
  for (int i = 0; i < n; ++i) rows.AppendRow(RandomRow(task, rng));
  return rows;
}

/// A FeatureNet's numbers as leaves in double precision, weight and bias of each layer in the order of its flat vector.
class TorchNet {
 public:
  explicit TorchNet(const FeatureNet& net) : net_(net) {
    const float* p = net.parameters().data();
    for (const Mlp::Layer& layer : net.layers()) {
      const size_t in = static_cast<size_t>(layer.in), out = static_cast<size_t>(layer.out);
      parameters.push_back(ToTensor({p + layer.weight, in * out}, layer.in, layer.out).requires_grad_());
      parameters.push_back(ToTensor({p + layer.bias, out}, 1, layer.out).requires_grad_());
    }
  }

  torch::Tensor Forward(const Array2<double>& rows) const {
    const Encoder& encoder = net_.encoder();
    const int64_t n = rows.rows();
    const size_t image_size =
        encoder.has_image() ? static_cast<size_t>(encoder.height() * encoder.width() * encoder.channels()) : 0;
    std::vector<float> images(rows.values().size() == 0 ? 0 : static_cast<size_t>(n) * image_size);
    std::vector<float> extra(static_cast<size_t>(n * encoder.n_extra()));
    for (int i = 0; i < rows.rows(); ++i) {
      const size_t at = static_cast<size_t>(i), width = static_cast<size_t>(encoder.n_extra());
      encoder.Encode(rows.row(i), net_.bound(), std::span(images).subspan(at * image_size, image_size),
                     std::span(extra).subspan(at * width, width));
    }
    torch::Tensor x = ToTensor(extra, n, encoder.n_extra());
    size_t k = 0;
    if (encoder.has_image()) {
      torch::Tensor y = ToTensor(images, n, static_cast<int64_t>(image_size))
                            .reshape({n, encoder.height(), encoder.width(), encoder.channels()})
                            .permute({0, 3, 1, 2});
      for (size_t l = 0; l < net_.size().filters.size(); ++l, k += 2) {
        const torch::Tensor weight =
            parameters[k].reshape({3, 3, y.size(1), net_.size().filters[l]}).permute({3, 2, 0, 1});
        y = torch::relu(torch::conv2d(y, weight, parameters[k + 1].reshape({-1})));
      }
      x = torch::cat({y.permute({0, 2, 3, 1}).flatten(1), x}, 1);
    }
    for (; k < parameters.size(); k += 2) {
      x = x.matmul(parameters[k]) + parameters[k + 1];
      if (k + 2 < parameters.size()) x = torch::relu(x);
    }
    return x;
  }

  std::vector<double> Flat() const { return Flattened(parameters); }

  std::vector<torch::Tensor> parameters;

 private:
  const FeatureNet& net_;
};

/// PPO's step as Stable-Baselines3 writes it, on autograd and in double precision. Same start as `update`.
class TorchPpo {
 public:
  TorchPpo(PpoUpdate& update, const PpoUpdateOptions& options)
      : actor(update.actor()),
        critic(update.critic()),
        options_(options),
        adam_(Joined(), torch::optim::AdamOptions(options.learning_rate).eps(1e-5)) {}

  PpoLosses Step(const PpoBatch& batch) {
    const int64_t n = batch.size();
    const torch::Tensor log_p = torch::log_softmax(actor.Forward(batch.observations), 1);
    const std::vector<int64_t> actions(batch.actions.begin(), batch.actions.end());
    const torch::Tensor log_prob = log_p.gather(1, torch::tensor(actions).reshape({n, 1}));
    const torch::Tensor old = ToTensor(batch.log_probs, n, 1), advantage = ToTensor(batch.advantages, n, 1);
    const torch::Tensor ratio = (log_prob - old).exp();
    const torch::Tensor policy_loss =
        -torch::minimum(advantage * ratio, advantage * ratio.clamp(1 - options_.clip_range, 1 + options_.clip_range))
             .mean();
    const torch::Tensor value_loss = torch::mse_loss(critic.Forward(batch.observations), ToTensor(batch.returns, n, 1));
    const torch::Tensor entropy = -(log_p.exp() * log_p).sum(1).mean();
    const torch::Tensor loss = policy_loss + options_.vf_coef * value_loss - options_.ent_coef * entropy;
    adam_.zero_grad();
    loss.backward();
    PpoLosses losses;
    losses.policy_loss = policy_loss.item<double>();
    losses.value_loss = value_loss.item<double>();
    losses.entropy = entropy.item<double>();
    losses.approx_kl = (ratio - 1 - (log_prob - old)).mean().item<double>();
    losses.clip_fraction = ((ratio - 1).abs() > options_.clip_range).to(torch::kFloat64).mean().item<double>();
    losses.gradient_norm = Shorten();
    adam_.step();
    return losses;
  }

  TorchNet actor, critic;

 private:
  std::vector<torch::Tensor> Joined() const {
    std::vector<torch::Tensor> all = actor.parameters;
    all.insert(all.end(), critic.parameters.begin(), critic.parameters.end());
    return all;
  }
  /// torch.nn.utils.clip_grad_norm_.
  double Shorten() {
    torch::Tensor square = torch::zeros({}, torch::kFloat64);
    for (const torch::Tensor& p : Joined()) square += p.grad().pow(2).sum();
    const double norm = square.sqrt().item<double>();
    for (const torch::Tensor& p : Joined()) p.mutable_grad() *= std::min(1.0, options_.max_grad_norm / (norm + 1e-6));
    return norm;
  }

  PpoUpdateOptions options_;
  torch::optim::Adam adam_;
};

/// A batch as in the middle of training: the ratios spread around 1, beyond the clip range on both sides.
PpoBatch RandomBatch(const Task& task, PpoUpdate& update, Rng& rng) {
  PpoBatch batch;
  batch.observations = RandomRows(task, kBatch, rng);
  std::vector<float> logits(kBatch * kActions), values(kBatch);
  update.Evaluate(batch.observations.values(), kBatch, logits, values);
  for (size_t i = 0; i < kBatch; ++i) {
    const auto action = static_cast<int>(rng.Below(kActions));
    batch.actions.push_back(action);
    double sum = 0;
    for (size_t a = 0; a < kActions; ++a) sum += std::exp(static_cast<double>(logits[i * kActions + a]));
    batch.log_probs.push_back(static_cast<float>(
        static_cast<double>(logits[i * kActions + static_cast<size_t>(action)]) - std::log(sum) + 0.2 * rng.Normal()));
    batch.advantages.push_back(static_cast<float>(rng.Normal()));
    batch.returns.push_back(static_cast<float>(values[i] + rng.Normal()));
  }
  return batch;
}

void CompareOverSteps(const Task& task, const PpoUpdateOptions& options) {
  SCOPED_TRACE(task.name);
  Rng rng(21);
  const Encoder encoder(RandomRows(task, 200, rng), task.shape);
  PpoUpdate update(encoder, task.size, kActions, options, rng);
  TorchPpo reference(update, options);
  int n_clipped = 0, n_shortened = 0;
  for (int step = 0; step < 25; ++step) {
    const PpoBatch batch = RandomBatch(task, update, rng);
    const PpoLosses ours = update.Step(batch), theirs = reference.Step(batch);
    EXPECT_NEAR(ours.policy_loss, theirs.policy_loss, kTolerance);
    EXPECT_NEAR(ours.value_loss, theirs.value_loss, kTolerance * std::max(1.0, theirs.value_loss));
    EXPECT_NEAR(ours.entropy, theirs.entropy, kTolerance);
    EXPECT_NEAR(ours.approx_kl, theirs.approx_kl, kTolerance);
    EXPECT_NEAR(ours.clip_fraction, theirs.clip_fraction, 1.5 / kBatch) << "a ratio on the edge may fall either way";
    EXPECT_NEAR(ours.gradient_norm, theirs.gradient_norm, kTolerance * std::max(1.0, theirs.gradient_norm));
    n_clipped += ours.clip_fraction > 0.1;
    n_shortened += ours.gradient_norm > options.max_grad_norm;
  }
  EXPECT_GT(n_clipped, 20) << "the case tests no clipping";
  EXPECT_EQ(n_shortened, options.max_grad_norm < 1 ? 25 : 0);
  EXPECT_LT(MaxDifference(update.actor().parameters(), reference.actor.Flat()), kTolerance);
  EXPECT_LT(MaxDifference(update.critic().parameters(), reference.critic.Flat()), kTolerance);
}

TEST(PpoUpdateAgainstAutograd, LossesAndParametersStayEqualOnVectors) {
  CompareOverSteps(kVector, {.ent_coef = 0.01, .max_grad_norm = 0.1});
}

TEST(PpoUpdateAgainstAutograd, LossesAndParametersStayEqualOnImages) {
  CompareOverSteps(WithLevels(kImage), {.ent_coef = 0.1, .vf_coef = 0.8, .max_grad_norm = 0.1});
}

TEST(PpoUpdateAgainstAutograd, AGradientBelowTheNormIsLeftAsItIs) {
  CompareOverSteps(kVector, {.clip_range = 0.1, .max_grad_norm = 1e3});
}

TEST(PpoUpdate, BeginsNearlyUniform) {
  Rng rng(3);
  PpoUpdate update(Encoder(RandomRows(kVector, 50, rng), {}), kVector.size, kActions, {}, rng);
  std::vector<float> logits(10 * kActions), values(10);
  update.Evaluate(RandomRows(kVector, 10, rng).values(), 10, logits, values);
  for (const float logit : logits) EXPECT_LT(std::abs(logit), 0.05f);
  EXPECT_GT(*std::max_element(values.begin(), values.end()), 0.05f) << "the value's head is not made small";
}

TEST(PpoUpdate, ARestoredUpdateGoesOnWithTheSameNumbers) {
  Rng rng(15);
  const Encoder encoder(RandomRows(kVector, 50, rng), {});
  PpoUpdate update(encoder, kVector.size, kActions, {}, rng);
  for (int step = 0; step < 5; ++step) update.Step(RandomBatch(kVector, update, rng));
  NpzArrays arrays;
  update.Save(arrays);
  PpoUpdate restored(encoder, kVector.size, kActions, {}, rng);
  restored.Restore(ParseNpz(NpzBytes(arrays), "memory"));
  for (int step = 0; step < 5; ++step) {
    const PpoBatch batch = RandomBatch(kVector, update, rng);
    const PpoLosses a = update.Step(batch), b = restored.Step(batch);
    EXPECT_EQ(a.policy_loss, b.policy_loss);
    EXPECT_EQ(a.value_loss, b.value_loss);
  }
  EXPECT_EQ(update.actor().parameters(), restored.actor().parameters());
  EXPECT_EQ(update.critic().parameters(), restored.critic().parameters());
}

}  // namespace oted::ppo_update_torch_test
