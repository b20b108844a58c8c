#include "oted/stages/behavior/behavioral_cloning.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"

namespace oted {

FieldList CloneConfig::Fields() {
  FieldList fields("clone");
  fields.Add("hidden", &hidden, "widths of the policy's hidden layers", AtLeast(1));
  fields.Add("learning_rate", &learning_rate, "Adam's step size", Above(0));
  fields.Add("weight_decay", &weight_decay, "L2 penalty added to the gradient", AtLeast(0));
  fields.Add("batch_size", &batch_size, "transitions per gradient step", AtLeast(1));
  fields.Add("max_steps", &max_steps, "gradient steps at most", AtLeast(1));
  fields.Add("held_out", &held_out, "fraction of the transitions held out for early stopping", Between(0.01, 0.5));
  fields.Add("patience", &patience, "checks without a better held-out loss before stopping", AtLeast(1));
  fields.Add("check_interval", &check_interval, "gradient steps between checks of the held-out loss", AtLeast(1));
  return fields;
}

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

}  // namespace

CloneResult CloneBehavior(const Dataset& dataset, const SimulatorSpec& spec, const CloneConfig& config, RngKey key,
                          const std::string& run_name, const RunContext& context) {
  dataset.CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  Rng rng = key.MakeRng();
  const int act_dim = spec.act_dim;

  std::vector<int> train_rows, held_out_rows;
  const int n_blocks = (dataset.size() + kBlock - 1) / kBlock;
  const int n_held_out =
      std::clamp(static_cast<int>(std::lround(config.held_out * n_blocks)), 1, std::max(1, n_blocks - 1));
  const std::vector<int> order = RandomPermutation(n_blocks, rng);
  for (int k = 0; k < n_blocks; ++k) {
    // With a single block there is nothing to hold out apart from itself.
    for (int i = order[static_cast<size_t>(k)] * kBlock;
         i < std::min(dataset.size(), (order[static_cast<size_t>(k)] + 1) * kBlock); ++i) {
      if (k < n_held_out) held_out_rows.push_back(i);
      if (k >= n_held_out || n_blocks == 1) train_rows.push_back(i);
    }
  }

  TanhGaussianPolicy policy(Normalizer::Fit(dataset.observations), config.hidden, spec.action_low, spec.action_high);
  policy.net().Initialize(rng);
  const CloneRows train = GatherRows(dataset, policy, train_rows),
                  held_out = GatherRows(dataset, policy, held_out_rows);

  ::oted::Adam adam(policy.net().n_parameters(), {.learning_rate = static_cast<float>(config.learning_rate),
                                                  .weight_decay = static_cast<float>(config.weight_decay)});
  const size_t obs_dim = static_cast<size_t>(spec.obs_dim()), width = static_cast<size_t>(act_dim);
  const size_t batch = static_cast<size_t>(std::min(config.batch_size, train.n));
  AlignedVector<float> x(batch * obs_dim), u(batch * width), dout(batch * 2 * width),
      gradient(policy.net().n_parameters());
  MlpPass pass, check_pass;
  CloneResult best{policy, 0, INFINITY, 0};
  double train_loss = 0;
  for (int step = 1, stale = 0; step <= config.max_steps && stale < config.patience; ++step) {
    for (size_t i = 0; i < batch; ++i) {
      const size_t row = rng.Below(static_cast<uint64_t>(train.n));
      std::copy_n(train.observations.data() + row * obs_dim, obs_dim, x.data() + i * obs_dim);
      std::copy_n(train.u.data() + row * width, width, u.data() + i * width);
    }
    const float* out = pass.Forward(policy.net(), x.data(), static_cast<int>(batch));
    const double loss = NegativeLogLikelihood(out, u.data(), static_cast<int>(batch), act_dim, dout.data());
    train_loss = step == 1 ? loss : 0.98 * train_loss + 0.02 * loss;
    pass.Backward(policy.net(), x.data(), dout.data(), static_cast<int>(batch), gradient.data(), nullptr);
    adam.Step({policy.net().parameters().data(), gradient.size()}, {gradient.data(), gradient.size()});

    if (step % config.check_interval != 0 && step != config.max_steps) continue;
    const float* check = check_pass.Forward(policy.net(), held_out.observations.data(), held_out.n);
    const double held_out_loss = NegativeLogLikelihood(check, held_out.u.data(), held_out.n, act_dim, nullptr);
    context.log->Scalar(run_name, "clone/train_loss", step, train_loss);
    context.log->Scalar(run_name, "clone/held_out_loss", step, held_out_loss);
    context.log->Progress("clone", run_name, step, config.max_steps,
                          fmt::format("held-out loss {:.3f}", held_out_loss));
    if (held_out_loss < best.held_out_loss) {
      best = {policy, train_loss, held_out_loss, step};
      stale = 0;
    } else {
      ++stale;
    }
    context.ThrowIfStopped();
  }
  context.log->Progress("clone", run_name, config.max_steps, config.max_steps,
                        fmt::format("held-out loss {:.3f} at step {}", best.held_out_loss, best.n_steps));
  return best;
}

}  // namespace oted
