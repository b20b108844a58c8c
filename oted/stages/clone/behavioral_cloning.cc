#include "oted/stages/clone/behavioral_cloning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/matching/experience.h"
#include "oted/nn/categorical.h"
#include "oted/nn/categorical_policy.h"
#include "oted/nn/tanh_gaussian.h"

namespace oted {

namespace {

constexpr int kBlock = 25;             // consecutive transitions that are held out, or trained on, together
constexpr float kLogStdFloor = -5.0f;  // exp(-5) < 0.01 of the action's half range: below it lies only over-fitting

/// Normalised observations and atanh(actions) of some rows.
struct CloneRows {
  int n = 0;
  AlignedVector<float> observations, u;
};

CloneRows GatherRows(const Dataset& dataset, const TanhGaussianPolicy& policy, const std::vector<int>& rows) {
  CloneRows out;
  out.n = static_cast<int>(rows.size());
  const size_t obs_dim = static_cast<size_t>(dataset.obs_dim());
  out.observations.resize(rows.size() * obs_dim);
  for (size_t i = 0; i < rows.size(); ++i) {
    policy.NormalizeObservations(dataset.observations.row(rows[i]), {out.observations.data() + i * obs_dim, obs_dim});
    for (int j = 0; j < dataset.act_dim(); ++j) {
      out.u.push_back(static_cast<float>(policy.UnsquashAction(dataset.actions(rows[i], j), j)));
    }
  }
  return out;
}

/// Mean negative log likelihood; fills `dout` (n, 2 act_dim) with its gradient at the network's output when not null.
double NegativeLogLikelihood(const float* out, const float* u, int n, int act_dim, float* dout) {
  double loss = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < act_dim; ++j) {
      const float raw = out[(2 * i + 1) * act_dim + j];
      const float log_std = std::clamp(raw, kLogStdFloor, kLogStdMax);
      const float z = (u[i * act_dim + j] - out[2 * i * act_dim + j]) * std::exp(-log_std);
      loss += 0.5 * z * z + log_std + 0.9189385332046727;
      if (dout == nullptr) continue;
      dout[2 * i * act_dim + j] = -z * std::exp(-log_std) / static_cast<float>(n);
      const bool inside = raw >= kLogStdFloor && raw <= kLogStdMax;
      dout[(2 * i + 1) * act_dim + j] = inside ? (1.0f - z * z) / static_cast<float>(n) : 0.0f;
    }
  }
  return loss / n;
}

/// What is fitted: its parameters, and its loss on rows of the data.
class CloneLearner {
 public:
  virtual ~CloneLearner() = default;
  virtual AlignedVector<float>& parameters() = 0;
  virtual int n_train() const = 0;
  /// Mean loss of the training rows `picks` (positions among them), and its gradient.
  virtual double Gradient(const std::vector<size_t>& picks, float* gradient) = 0;
  virtual double HeldOutLoss() = 0;
  virtual std::unique_ptr<Policy> Copy() const = 0;
};

class TanhGaussianLearner : public CloneLearner {
 public:
  TanhGaussianLearner(const Dataset& dataset, const SimulatorSpec& spec, const CloneConfig& config, Rng& rng,
                      const std::vector<int>& train, const std::vector<int>& held_out)
      : policy_(Normalizer::Fit(dataset.observations), config.hidden, spec.action_low, spec.action_high) {
    policy_.net().Initialize(rng);
    train_ = GatherRows(dataset, policy_, train);
    held_out_ = GatherRows(dataset, policy_, held_out);
  }
  AlignedVector<float>& parameters() override { return policy_.net().parameters(); }
  int n_train() const override { return train_.n; }

  double Gradient(const std::vector<size_t>& picks, float* gradient) override {
    const size_t obs_dim = static_cast<size_t>(policy_.obs_dim()), width = static_cast<size_t>(policy_.act_dim());
    const int batch = static_cast<int>(picks.size());
    x_.resize(picks.size() * obs_dim);
    u_.resize(picks.size() * width);
    dout_.resize(picks.size() * 2 * width);
    for (size_t i = 0; i < picks.size(); ++i) {
      std::copy_n(train_.observations.data() + picks[i] * obs_dim, obs_dim, x_.data() + i * obs_dim);
      std::copy_n(train_.u.data() + picks[i] * width, width, u_.data() + i * width);
    }
    const float* out = pass_.Forward(policy_.net(), x_.data(), batch);
    const double loss = NegativeLogLikelihood(out, u_.data(), batch, policy_.act_dim(), dout_.data());
    pass_.Backward(policy_.net(), x_.data(), dout_.data(), batch, {.parameters = gradient});
    return loss;
  }

  double HeldOutLoss() override {
    const float* out = check_pass_.Forward(policy_.net(), held_out_.observations.data(), held_out_.n);
    return NegativeLogLikelihood(out, held_out_.u.data(), held_out_.n, policy_.act_dim(), nullptr);
  }
  std::unique_ptr<Policy> Copy() const override { return std::make_unique<TanhGaussianPolicy>(policy_); }

 private:
  TanhGaussianPolicy policy_;
  CloneRows train_, held_out_;
  MlpPass pass_, check_pass_;
  AlignedVector<float> x_, u_, dout_;
};

class CategoricalLearner : public CloneLearner {
 public:
  CategoricalLearner(const Dataset& dataset, const SimulatorSpec& spec, const CloneConfig& config, Rng& rng,
                     std::vector<int> train, std::vector<int> held_out)
      : dataset_(dataset),
        policy_(dataset.observations, ObservationShape(spec), {config.hidden, config.filters, false},
                spec.n_discrete_actions),
        train_(std::move(train)),
        held_out_(std::move(held_out)) {
    for (int i = 0; i < dataset.size(); ++i) {
      const double action = dataset.actions(i, 0);
      if (action >= 0 && action < spec.n_discrete_actions && action == std::floor(action)) continue;
      throw DataError(
          fmt::format("dataset '{}': action [{}] is {:g}, wanted an index below {}, as task '{}' takes; name the task "
                      "that the data were logged from",
                      dataset.path, i, action, spec.n_discrete_actions, spec.task));
    }
    policy_.net().Initialize(rng);
  }
  AlignedVector<float>& parameters() override { return policy_.net().parameters(); }
  int n_train() const override { return static_cast<int>(train_.size()); }

  double Gradient(const std::vector<size_t>& picks, float* gradient) override {
    rows_.clear();
    for (const size_t pick : picks) rows_.push_back(train_[pick]);
    dout_.resize(rows_.size() * static_cast<size_t>(policy_.n_actions()));
    const double loss = Loss(rows_, {dout_.data(), dout_.size()});
    pass_.Backward(policy_.net(), dout_.data(), gradient);
    return loss;
  }
  double HeldOutLoss() override { return Loss(held_out_, {}); }
  std::unique_ptr<Policy> Copy() const override { return std::make_unique<CategoricalPolicy>(policy_); }

 private:
  double Loss(const std::vector<int>& rows, std::span<float> gradient) {
    pass_.Reserve(policy_.net(), static_cast<int>(rows.size()));
    std::vector<int> actions;
    for (size_t i = 0; i < rows.size(); ++i) {
      pass_.Encode(policy_.net(), dataset_.observations.row(rows[i]), static_cast<int>(i));
      actions.push_back(static_cast<int>(dataset_.actions(rows[i], 0)));
    }
    const float* logits = pass_.Forward(policy_.net());
    const auto n = static_cast<size_t>(policy_.n_actions());
    return CategoricalLoss({logits, rows.size() * n}, policy_.n_actions(), actions, gradient);
  }

  const Dataset& dataset_;
  CategoricalPolicy policy_;
  std::vector<int> train_, held_out_, rows_;
  FeaturePass pass_;
  AlignedVector<float> dout_;
};

}  // namespace

CloneRowSplit SplitCloneRows(const Dataset& dataset, double held_out, Rng& rng) {
  CloneRowSplit rows;
  const int n_blocks = (dataset.size() + kBlock - 1) / kBlock;
  const int n_held_out = std::clamp(static_cast<int>(std::lround(held_out * n_blocks)), 1, std::max(1, n_blocks - 1));
  const std::vector<int> order = RandomPermutation(n_blocks, rng);
  for (int k = 0; k < n_blocks; ++k) {
    // With a single block there is nothing to hold out apart from itself.
    for (int i = order[static_cast<size_t>(k)] * kBlock;
         i < std::min(dataset.size(), (order[static_cast<size_t>(k)] + 1) * kBlock); ++i) {
      if (k < n_held_out) rows.held_out.push_back(i);
      if (k >= n_held_out || n_blocks == 1) rows.train.push_back(i);
    }
  }
  return rows;
}

double LogLoss(const TanhGaussianPolicy& policy, const Dataset& dataset, const std::vector<int>& rows) {
  const CloneRows gathered = GatherRows(dataset, policy, rows);
  MlpPass pass;
  const float* out = pass.Forward(policy.net(), gathered.observations.data(), gathered.n);
  return NegativeLogLikelihood(out, gathered.u.data(), gathered.n, policy.act_dim(), nullptr);
}

CloneResult CloneByLikelihood(const CloneJob& job) {
  const auto& [dataset, spec, config, key, run_name, context, unused] = job;
  dataset.CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  Rng rng = key.MakeRng();
  const CloneRowSplit rows = SplitCloneRows(dataset, config.held_out, rng);

  std::unique_ptr<CloneLearner> learner;
  if (spec.n_discrete_actions > 0) {
    learner = std::make_unique<CategoricalLearner>(dataset, spec, config, rng, rows.train, rows.held_out);
  } else {
    learner = std::make_unique<TanhGaussianLearner>(dataset, spec, config, rng, rows.train, rows.held_out);
  }
  const size_t n_parameters = learner->parameters().size();
  ::oted::Adam adam(n_parameters, {.learning_rate = static_cast<float>(config.learning_rate),
                                   .weight_decay = static_cast<float>(config.weight_decay)});
  std::vector<size_t> picks(static_cast<size_t>(std::min(config.batch_size, learner->n_train())));
  AlignedVector<float> gradient(n_parameters);
  CloneResult best{learner->Copy(), 0, INFINITY, 0, CloneMethod::kBehavioralCloning, {}};
  double train_loss = 0;
  for (int step = 1, stale = 0; step <= config.max_steps && stale < config.patience; ++step) {
    for (size_t& pick : picks) pick = rng.Below(static_cast<uint64_t>(learner->n_train()));
    const double loss = learner->Gradient(picks, gradient.data());
    train_loss = step == 1 ? loss : 0.98 * train_loss + 0.02 * loss;
    adam.Step({learner->parameters().data(), n_parameters}, {gradient.data(), n_parameters});

    if (step % config.check_interval != 0 && step != config.max_steps) continue;
    const double held_out_loss = learner->HeldOutLoss();
    context.log->Scalar(run_name, "clone/train_loss", step, train_loss);
    context.log->Scalar(run_name, "clone/held_out_loss", step, held_out_loss);
    context.log->Progress("clone", run_name, step, config.max_steps,
                          fmt::format("held-out loss {:.3f}", held_out_loss));
    if (held_out_loss < best.held_out_loss) {
      best = {learner->Copy(), train_loss, held_out_loss, step, CloneMethod::kBehavioralCloning, {}};
      stale = 0;
    } else {
      ++stale;
    }
    context.ThrowIfStopped();
  }
  if (!std::isfinite(best.held_out_loss)) {
    throw DataError(
        fmt::format("the clone's network diverged: after none of {} gradient steps its loss on the held-out rows is "
                    "finite; lower clone.learning_rate ({:g})",
                    config.max_steps, config.learning_rate));
  }
  context.log->Progress("clone", run_name, config.max_steps, config.max_steps,
                        fmt::format("held-out loss {:.3f} at step {}", best.held_out_loss, best.n_steps));
  return best;
}

}  // namespace oted
