#include "oted/baselines/mbop.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/base/sizes.h"
#include "oted/base/statistics.h"
#include "oted/nn/planner_policy.h"
#include "oted/rl/learned_state.h"
#include "oted/rl/offline/offline_rows.h"
#include "oted/rl/training.h"

namespace oted {

FieldList MbopConfig::Fields() {
  FieldList fields("mbop");
  fields.Add("n_steps", &n_steps, "gradient steps of each network", AtLeast(1));
  fields.Add("batch_size", &batch_size, "logged rows per gradient step", BatchSizes());
  fields.Add("members", &members, "networks in each of the three ensembles", Between(1, 100));
  fields.Add("hidden", &hidden, "widths of their hidden layers", LayerWidths());
  fields.Add("learning_rate", &learning_rate, "Adam's step size", Above(0));
  fields.Add("horizon", &horizon, "control steps of a plan, and of the rewards that its value sums up",
             Between(1, 1000));
  fields.Add("trajectories", &trajectories, "simulated for each plan", Between(1, 10000));
  fields.Add("noise", &noise, "deviation of their actions from the prior's, for actions in [-1, 1]", AtLeast(0));
  fields.Add("keep", &keep, "share of the former plan in an action", {.low = 0, .high = 1, .high_open = true});
  fields.Add("sharpness", &sharpness, "a trajectory's weight is exp(sharpness * its return)", AtLeast(0));
  return fields;
}

void CheckMbop(const Dataset& dataset, const MbopConfig& config) {
  int longest = 0;
  for (const Episode& episode : dataset.Episodes()) longest = std::max(longest, episode.size());
  if (longest >= config.horizon) return;
  throw DataError(fmt::format("dataset '{}': its longest episode has {} transitions, mbop.horizon is {}; lower it",
                              dataset.path, longest, config.horizon));
}

namespace {

/// Inputs and wanted outputs of one kind of network.
struct RegressionRows {
  size_t in = 0, out = 0;
  std::vector<float> x, y;
  size_t size() const { return y.size() / out; }
};

/// A network, its optimiser and its own stream of batches.
struct Regression {
  Mlp net;
  Adam adam;
  MlpPass pass;
  AlignedVector<float> x, y, dy, gradient;
  double loss = 0;

  /// One step on the mean squared error, summed over the outputs.
  void Step(const RegressionRows& rows, int batch_size, Rng& rng) {
    const size_t n = static_cast<size_t>(batch_size);
    x.resize(n * rows.in);
    y.resize(n * rows.out);
    dy.resize(y.size());
    gradient.resize(net.n_parameters());
    for (size_t b = 0; b < n; ++b) {
      const size_t row = rng.Below(rows.size());
      std::copy_n(rows.x.data() + row * rows.in, rows.in, x.data() + b * rows.in);
      std::copy_n(rows.y.data() + row * rows.out, rows.out, y.data() + b * rows.out);
    }
    const float* got = pass.Forward(net, x.data(), batch_size);
    loss = 0;
    for (size_t k = 0; k < y.size(); ++k) {
      const float error = got[k] - y[k];
      loss += static_cast<double>(error) * error / static_cast<double>(n);
      dy[k] = 2.0f * error / static_cast<float>(n);
    }
    pass.Backward(net, x.data(), dy.data(), batch_size, {.parameters = gradient.data()});
    adam.Step(net.parameters(), gradient);
  }
};

/// Of columns that hardly vary the scale is 1.
std::pair<double, double> UnitsOf(const std::vector<double>& values) {
  const double mean = Mean(values);
  double square = 0;
  for (const double v : values) square += (v - mean) * (v - mean);
  const double deviation = std::sqrt(square / static_cast<double>(values.size()));
  return {mean, deviation > 1e-9 * (1 + std::abs(mean)) ? deviation : 1};
}

/// The logs as the three kinds of networks see them.
struct PlannerData {
  PlannerUnits units;
  RegressionRows dynamics, prior, value;

  PlannerData(const Dataset& dataset, const SimulatorSpec& spec, int horizon) {
    units.observation = Normalizer::Fit(dataset.observations);
    units.action_low = spec.action_low;
    units.action_high = spec.action_high;
    std::tie(units.reward_mean, units.reward_scale) = UnitsOf(dataset.rewards);
    std::vector<double> sums;
    for (const Episode& episode : dataset.Episodes()) {
      for (int i = episode.begin; i + horizon <= episode.end; ++i) sums.push_back(SumFrom(dataset, i, horizon));
    }
    std::tie(units.value_mean, units.value_scale) = UnitsOf(sums);
    const size_t obs_dim = static_cast<size_t>(dataset.obs_dim()), act_dim = static_cast<size_t>(dataset.act_dim());
    for (RegressionRows* rows : {&dynamics, &prior, &value}) rows->in = obs_dim + act_dim;
    dynamics.out = obs_dim + 1;
    prior.out = act_dim;
    value.out = 1;
    for (const Episode& episode : dataset.Episodes()) {
      for (int i = episode.begin; i < episode.end; ++i) AddRow(dataset, spec, episode, i, horizon);
    }
  }

 private:
  static double SumFrom(const Dataset& dataset, int i, int horizon) {
    const auto begin = dataset.rewards.begin() + i;
    return std::accumulate(begin, begin + horizon, 0.0);
  }

  void AddRow(const Dataset& dataset, const SimulatorSpec& spec, const Episode& episode, int i, int horizon) {
    const auto observation = [&](std::span<const double> raw) {
      std::vector<float> values(raw.size());
      units.observation.Apply(raw, values);
      return values;
    };
    const auto action = [&](int row) {
      std::vector<float> values;
      for (int j = 0; j < dataset.act_dim(); ++j) {
        values.push_back(static_cast<float>(row < episode.begin ? 0 : ToUnitAction(spec, dataset.actions(row, j), j)));
      }
      return values;
    };
    const auto put = [](std::vector<float>& to, const std::vector<float>& values) {
      to.insert(to.end(), values.begin(), values.end());
    };
    const std::vector<float> state = observation(dataset.observations.row(i)), here = action(i);
    put(dynamics.x, state);
    put(dynamics.x, here);
    put(dynamics.y, observation(dataset.next_observations.row(i)));
    const double reward = dataset.rewards[static_cast<size_t>(i)];
    dynamics.y.push_back(static_cast<float>((reward - units.reward_mean) / units.reward_scale));
    put(prior.x, state);
    put(prior.x, action(i - 1));
    put(prior.y, here);
    if (i + horizon > episode.end) return;
    put(value.x, state);
    put(value.x, here);
    value.y.push_back(static_cast<float>((SumFrom(dataset, i, horizon) - units.value_mean) / units.value_scale));
  }
};

class MbopLearner : public OfflineLearner {
 public:
  MbopLearner(const OfflineJob& job, const MbopConfig& config)
      : config_(config),
        n_threads_(job.context.n_threads),
        data_(job.dataset, job.spec, config.horizon),
        members_(static_cast<size_t>(config.members)) {
    for (size_t k = 0; k < members_.size(); ++k) {
      const RngKey key = job.key.Stage("member").Index(k);
      Rng start = key.Stage("start").MakeRng();
      members_[k].rng = key.Stage("training").MakeRng();
      for (const auto& [kind, rows] : Kinds()) {
        Regression& regression = members_[k].*kind;
        regression.net = Mlp(static_cast<int>(rows->in), config.hidden, static_cast<int>(rows->out));
        regression.net.Initialize(start);
        regression.adam =
            Adam(regression.net.n_parameters(), {.learning_rate = static_cast<float>(config.learning_rate)});
      }
    }
  }

  int64_t n_steps() const override { return n_steps_; }
  int64_t total() const override { return config_.n_steps; }

  /// A member sees no other, so that they may learn side by side.
  void Step() override {
    ParallelFor(config_.members, n_threads_, [&](int k) {
      Member& member = members_[static_cast<size_t>(k)];
      for (const auto& [kind, rows] : Kinds()) (member.*kind).Step(*rows, config_.batch_size, member.rng);
    });
    ++n_steps_;
  }

  std::vector<std::pair<std::string, double>> Losses() const override {
    const auto mean = [&](Regression Member::*kind) {
      double sum = 0;
      for (const Member& member : members_) sum += (member.*kind).loss / static_cast<double>(members_.size());
      return sum;
    };
    return {{"train/dynamics_loss", mean(&Member::dynamics)},
            {"train/prior_loss", mean(&Member::prior)},
            {"train/value_loss", mean(&Member::value)}};
  }

  std::unique_ptr<Policy> MakePolicy() const override {
    std::vector<PlannerMember> nets;
    for (const Member& member : members_) nets.push_back({member.dynamics.net, member.prior.net, member.value.net});
    return std::make_unique<PlannerPolicy>(
        std::move(nets), data_.units,
        PlanOptions{config_.horizon, config_.trajectories, config_.noise, config_.keep, config_.sharpness});
  }

  void Save(NpzArrays& arrays) override {
    arrays["counters"] = NpyArray(std::vector<int64_t>{n_steps_});
    for (size_t k = 0; k < members_.size(); ++k) {
      State(k).Save(arrays);
      arrays[fmt::format("mbop/{}/rng", k)] = RngArray(members_[k].rng);
      arrays[fmt::format("mbop/{}/losses", k)] =
          NpyArray(std::vector<double>{members_[k].dynamics.loss, members_[k].prior.loss, members_[k].value.loss});
    }
  }
  void Restore(const NpzArrays& arrays) override {
    n_steps_ = CheckpointValues<int64_t>(arrays, "counters", 1)[0];
    for (size_t k = 0; k < members_.size(); ++k) {
      State(k).Restore(arrays);
      RestoreRng(arrays, fmt::format("mbop/{}/rng", k).c_str(), members_[k].rng);
      const auto& losses = CheckpointValues<double>(arrays, fmt::format("mbop/{}/losses", k), 3);
      members_[k].dynamics.loss = losses[0];
      members_[k].prior.loss = losses[1];
      members_[k].value.loss = losses[2];
    }
  }

 private:
  struct Member {
    Regression dynamics, prior, value;
    Rng rng{0};
  };
  using Kind = std::pair<Regression Member::*, const RegressionRows*>;
  std::array<Kind, 3> Kinds() const {
    return {Kind{&Member::dynamics, &data_.dynamics}, Kind{&Member::prior, &data_.prior},
            Kind{&Member::value, &data_.value}};
  }
  LearnedState State(size_t k) {
    LearnedState state(fmt::format("mbop/{}/", k));
    state.Add("dynamics", members_[k].dynamics.net.parameters(), members_[k].dynamics.adam);
    state.Add("prior", members_[k].prior.net.parameters(), members_[k].prior.adam);
    state.Add("value", members_[k].value.net.parameters(), members_[k].value.adam);
    return state;
  }

  MbopConfig config_;
  int n_threads_;
  PlannerData data_;
  std::vector<Member> members_;
  int64_t n_steps_ = 0;
};

}  // namespace

std::unique_ptr<OfflineLearner> MakeMbop(const OfflineJob& job, const MbopConfig& config) {
  CheckHasRewards(job.dataset);
  CheckMbop(job.dataset, config);
  return std::make_unique<MbopLearner>(job, config);
}

}  // namespace oted
