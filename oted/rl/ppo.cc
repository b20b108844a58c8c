#include "oted/rl/ppo.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "oted/base/error.h"
#include "oted/base/sizes.h"
#include "oted/base/statistics.h"
#include "oted/nn/categorical.h"
#include "oted/rl/gae.h"
#include "oted/rl/ppo_update.h"
#include "oted/rl/training_lanes.h"
#include "oted/sim/rollout.h"

namespace oted {

FieldList PpoConfig::Fields() {
  FieldList fields("ppo");
  fields.Add("n_steps", &n_steps, "control steps that one agent trains for, over all lanes", AtLeast(1));
  fields.Add("n_lanes", &n_lanes, "simulators stepped together", LaneCounts());
  fields.Add("rollout_steps", &rollout_steps, "control steps of each lane between two rounds of updates", AtLeast(1));
  fields.Add("n_epochs", &n_epochs, "passes over a rollout's samples", AtLeast(1));
  fields.Add("batch_size", &batch_size, "samples per gradient step", BatchSizes());
  fields.Add("hidden", &hidden, "widths of the hidden layers of policy and value", LayerWidths());
  fields.Add("filters", &filters, "filters of the 3x3 convolutions before them; only for images", AtLeast(1));
  fields.Add("learning_rate", &learning_rate, "Adam's step size", Above(0));
  fields.Add("gamma", &gamma, "discount factor", Between(0, 1));
  fields.Add("gae_lambda", &gae_lambda, "decay of the advantage estimate over steps", Between(0, 1));
  fields.Add("clip_range", &clip_range, "ratios of probabilities are clipped this far from 1", Above(0));
  fields.Add("ent_coef", &ent_coef, "weight of the entropy bonus", AtLeast(0));
  fields.Add("vf_coef", &vf_coef, "weight of the value loss", AtLeast(0));
  fields.Add("max_grad_norm", &max_grad_norm, "longest gradient; longer ones are scaled down", Above(0));
  fields.Add("normalize_advantage", &normalize_advantage, "advantages of a batch get mean 0 and deviation 1");
  fields.Add("eval_interval", &eval_interval, "control steps between evaluations", AtLeast(1));
  fields.Add("eval_episodes", &eval_episodes, "episodes per evaluation", EpisodeCounts());
  fields.AddChoice("keep", &keep, "which policy training returns: the best evaluated one, or the last",
                   KeptPolicyNames());
  fields.AddChoice("evaluate", &evaluate,
                   "how a policy over discrete actions acts in evaluations: a drawn action, or the most probable one",
                   NamedValues<ActionNoise>{{ActionNoise::kSampled, "sampled"}, {ActionNoise::kMean, "most_probable"}});
  return fields;
}

namespace {

constexpr int64_t kLargestRollout = 10'000'000;  // samples

// What is played with random actions to see which indices occur and how large quantities are.
constexpr int kPlayLanes = 16, kPlaySteps = 256;

Encoder FitEncoder(const SimulatorFactory& factory, EpisodeSource& source, Rng rng) {
  const auto simulator = factory.Make(kPlayLanes, 1);
  const SimulatorSpec& spec = factory.spec();
  const BatchPolicy act = UniformRandomPolicy(spec, rng);
  std::vector<int> lanes(kPlayLanes);
  std::vector<double> actions(kPlayLanes);
  const auto start = [&](int lane) {
    simulator->SetParameters(lane, source.Draw(lane, rng));
    simulator->Reset(lane, rng);
  };
  for (int lane = 0; lane < kPlayLanes; ++lane) start(lanes[static_cast<size_t>(lane)] = lane);
  Array2<double> rows;
  for (int step = 0; step < kPlaySteps; ++step) {
    for (const int lane : lanes) rows.AppendRow(simulator->observation(lane));
    act({}, kPlayLanes, actions);
    simulator->Step(lanes, actions);
    for (const int lane : lanes) {
      if (simulator->status(lane) != LaneStatus::kRunning) start(lane);
    }
  }
  return Encoder(rows, {spec.image_shape, spec.observation_levels});
}

/// The state of one training run between segments, and its segment.
class PpoTraining : public Learner {
 public:
  PpoTraining(const SimulatorFactory& factory, EpisodeSource& source, const PpoConfig& config, RngKey key,
              int n_threads)
      : config_(config),
        source_(source),
        lanes_(factory, source, config.n_lanes, n_threads),
        n_actions_(factory.spec().n_discrete_actions),
        rng_(key.Stage("training").MakeRng()),
        observations_(config.rollout_steps * config.n_lanes, factory.spec().obs_dim()) {
    const size_t n = static_cast<size_t>(observations_.rows());
    actions_.resize(n);
    for (auto* v : {&log_probs_, &rewards_, &values_, &advantages_, &returns_}) v->resize(n);
    ends_.resize(n);
    Rng init = key.Stage("initialisation").MakeRng();
    update_.emplace(FitEncoder(factory, source, key.Stage("first play").MakeRng()),
                    NetSize{config.hidden, config.filters, false}, n_actions_,
                    PpoUpdateOptions{.learning_rate = config.learning_rate,
                                     .clip_range = config.clip_range,
                                     .ent_coef = config.ent_coef,
                                     .vf_coef = config.vf_coef,
                                     .max_grad_norm = config.max_grad_norm},
                    init);
  }

  int64_t n_steps() const override { return n_steps_; }
  std::vector<float> PolicyParameters() const override {
    const auto& net = update_->policy().net().parameters();
    return {net.begin(), net.end()};
  }
  CategoricalPolicy PolicyOf(std::span<const float> parameters) const {
    CategoricalPolicy policy = update_->policy();
    std::ranges::copy(parameters, policy.net().parameters().begin());
    return policy;
  }
  std::unique_ptr<Policy> MakePolicy(std::span<const float> parameters) const override {
    return std::make_unique<CategoricalPolicy>(PolicyOf(parameters));
  }
  const EpisodeStatistics& episodes() const override { return lanes_.episodes(); }
  std::vector<std::pair<std::string, double>> Losses() const override {
    std::vector<std::pair<std::string, double>> figures = {{"train/policy_gradient_loss", losses_.policy_loss},
                                                           {"train/value_loss", losses_.value_loss},
                                                           {"train/entropy_loss", -losses_.entropy},
                                                           {"train/approx_kl", losses_.approx_kl},
                                                           {"train/clip_fraction", losses_.clip_fraction},
                                                           {"train/explained_variance", explained_variance_}};
    for (auto& figure : source_.Figures()) figures.push_back(std::move(figure));
    return figures;
  }

  void RunSegment(int64_t end, const std::function<void()>& tick) override {
    lanes_.BeginSegment(rng_);
    while (n_steps_ < end) {
      CollectRollout();
      LearnFromRollout();
      tick();
    }
  }

  void Save(NpzArrays& arrays) override {
    update_->Save(arrays);
    source_.Save(arrays);
    lanes_.Save(arrays);
    arrays["counters"] = NpyArray(std::vector<int64_t>{n_steps_});
    arrays["rng"] = RngArray(rng_);
  }

  void Restore(const NpzArrays& arrays) override {
    update_->Restore(arrays);
    source_.Restore(arrays);
    lanes_.Restore(arrays);
    n_steps_ = CheckpointValues<int64_t>(arrays, "counters", 1)[0];
    RestoreRng(arrays, "rng", rng_);
  }

 private:
  void CollectRollout() {
    const size_t n = lanes_.all().size(), k = static_cast<size_t>(n_actions_);
    std::vector<float> logits(n * k), log_p(k);
    std::vector<double> actions(n);
    for (size_t t = 0; t < static_cast<size_t>(config_.rollout_steps); ++t) {
      for (size_t lane = 0; lane < n; ++lane) {
        const auto observation = lanes_.simulator().observation(lanes_.all()[lane]);
        std::copy(observation.begin(), observation.end(), observations_.row(static_cast<int>(t * n + lane)).begin());
      }
      const size_t obs_dim = static_cast<size_t>(observations_.cols());
      update_->Evaluate(observations_.values().subspan(t * n * obs_dim, n * obs_dim), config_.n_lanes, logits,
                        {values_.data() + t * n, n});
      for (size_t lane = 0; lane < n; ++lane) {
        const std::span<const float> row(logits.data() + lane * k, k);
        const int action = SampleCategorical(row, rng_);
        LogSoftmax(row, n_actions_, log_p);
        actions_[t * n + lane] = action;
        log_probs_[t * n + lane] = log_p[static_cast<size_t>(action)];
        actions[lane] = action;
      }
      lanes_.Step(actions);
      for (size_t lane = 0; lane < n; ++lane) EndStep(lanes_.all()[lane], t * n + lane);
      n_steps_ += config_.n_lanes;
    }
    std::vector<float> last_values;
    for (const int lane : lanes_.all()) last_values.push_back(ValueOf(lane));
    GeneralizedAdvantages({rewards_, values_, ends_, last_values}, config_.gamma, config_.gae_lambda,
                          {advantages_, returns_});
  }

  /// What the step at `row` of the rollout came to, and a new episode where one ended.
  void EndStep(int lane, size_t row) {
    const LaneStatus status = lanes_.simulator().status(lane);
    const bool diverged = status == LaneStatus::kDiverged;
    rewards_[row] = diverged ? 0.0f : static_cast<float>(lanes_.simulator().reward(lane));
    ends_[row] = diverged ? StepEnd::kDropped : status == LaneStatus::kRunning ? StepEnd::kNone : StepEnd::kEpisode;
    if (status == LaneStatus::kRunning) return;
    // A time limit is no end: what would have followed is in the reward.
    if (status == LaneStatus::kTruncated) rewards_[row] += static_cast<float>(config_.gamma) * ValueOf(lane);
    lanes_.Next(lane, rng_);
  }

  float ValueOf(int lane) {
    float value = 0;
    update_->EvaluateValues(lanes_.simulator().observation(lane), 1, {&value, 1});
    return value;
  }

  void LearnFromRollout() {
    std::vector<int> rows;
    for (size_t row = 0; row < ends_.size(); ++row) {
      if (ends_[row] != StepEnd::kDropped) rows.push_back(static_cast<int>(row));
    }
    ExplainValues(rows);
    const size_t batch_size = static_cast<size_t>(config_.batch_size);
    for (int epoch = 0; epoch < config_.n_epochs; ++epoch) {
      const std::vector<int> order = RandomPermutation(static_cast<int>(rows.size()), rng_);
      for (size_t begin = 0; begin < order.size(); begin += batch_size) {
        const size_t end = std::min(order.size(), begin + batch_size);
        GatherBatch(rows, {order.data() + begin, end - begin});
        losses_ = update_->Step(batch_);
        CheckStillLearns(losses_.policy_loss + losses_.value_loss, "ppo", config_.learning_rate, n_steps_);
      }
    }
  }

  void GatherBatch(const std::vector<int>& rows, std::span<const int> picks) {
    const size_t n = picks.size();
    if (batch_.observations.rows() != static_cast<int>(n)) {
      batch_.observations = Array2<double>(static_cast<int>(n), observations_.cols());
    }
    batch_.actions.resize(n);
    for (auto* v : {&batch_.log_probs, &batch_.advantages, &batch_.returns}) v->resize(n);
    std::vector<double> advantages(n);
    for (size_t i = 0; i < n; ++i) {
      const int row = rows[static_cast<size_t>(picks[i])];
      const size_t at = static_cast<size_t>(row);
      std::ranges::copy(observations_.row(row), batch_.observations.row(static_cast<int>(i)).begin());
      batch_.actions[i] = actions_[at];
      batch_.log_probs[i] = log_probs_[at];
      batch_.returns[i] = returns_[at];
      advantages[i] = static_cast<double>(advantages_[at]);
    }
    const bool normalize = config_.normalize_advantage && n > 1;
    const double mean = normalize ? Mean(advantages) : 0, scale = normalize ? StandardDeviation(advantages) + 1e-8 : 1;
    for (size_t i = 0; i < n; ++i) batch_.advantages[i] = static_cast<float>((advantages[i] - mean) / scale);
  }

  /// 1 - Var(R - V) / Var(R): how much of the returns the value foresaw.
  void ExplainValues(const std::vector<int>& rows) {
    std::vector<double> returns, errors;
    for (const int row : rows) {
      const size_t at = static_cast<size_t>(row);
      returns.push_back(static_cast<double>(returns_[at]));
      errors.push_back(static_cast<double>(returns_[at] - values_[at]));
    }
    const double all = StandardDeviation(returns), rest = StandardDeviation(errors);
    explained_variance_ = all > 0 ? 1 - rest * rest / (all * all) : 0;
  }

  const PpoConfig& config_;
  EpisodeSource& source_;
  TrainingLanes lanes_;
  int n_actions_;
  Rng rng_;
  std::optional<PpoUpdate> update_;
  PpoBatch batch_;
  PpoLosses losses_;
  double explained_variance_ = 0;
  int64_t n_steps_ = 0;
  // One rollout, (rollout_steps, n_lanes).
  Array2<double> observations_;
  std::vector<int> actions_;
  std::vector<float> log_probs_, rewards_, values_, advantages_, returns_;
  std::vector<StepEnd> ends_;
};

}  // namespace

PpoResult TrainAgent(const AgentJob& job, const PpoConfig& config) {
  const SimulatorSpec& spec = job.factory.spec();
  if (spec.n_discrete_actions == 0) {
    throw UsageError(fmt::format("task '{}' has continuous actions, PPO takes discrete ones alone", spec.task));
  }
  if (int64_t{config.rollout_steps} * config.n_lanes > kLargestRollout) {
    throw UsageError(fmt::format("ppo.rollout_steps = {} by ppo.n_lanes = {} are more than {} samples; lower either",
                                 config.rollout_steps, config.n_lanes, kLargestRollout));
  }
  PpoTraining training(job.factory, job.source, config, job.key, job.context.n_threads);
  PpoResult result;
  static_cast<LearningCurve&>(result) = TrainInSegments(
      training, job, {config.n_steps, config.eval_interval, config.eval_episodes, config.keep, config.evaluate});
  result.policy = training.PolicyOf(result.kept);
  return result;
}

}  // namespace oted
