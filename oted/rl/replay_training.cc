#include "oted/rl/replay_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <future>
#include <numeric>
#include <optional>

#include "oted/base/error.h"
#include "oted/base/sizes.h"
#include "oted/rl/multi_step.h"
#include "oted/rl/observation_statistics.h"
#include "oted/rl/replay_buffer.h"
#include "oted/rl/starts.h"
#include "oted/rl/training_lanes.h"

namespace oted {

void ReplayConfig::AddFields(FieldList& fields) {
  fields.Add("n_steps", &n_steps, "control steps that one agent trains for, over all lanes", AtLeast(1));
  fields.Add("n_lanes", &n_lanes, "simulators stepped together; several of them step during gradient steps",
             LaneCounts());
  fields.Add("updates_per_step", &updates_per_step, "gradient steps per control step", Above(0));
  fields.Add("learning_starts", &learning_starts, "control steps with uniform random actions before the first update",
             AtLeast(1));
  fields.Add("batch_size", &batch_size, "transitions per gradient step", BatchSizes());
  fields.Add("buffer_size", &buffer_size, "transitions kept for replay", AtLeast(1));
  fields.Add("learning_rate", &learning_rate, "Adam's step size for actor, critics and temperature", Above(0));
  fields.Add("gamma", &gamma, "discount factor", Between(0, 1));
  fields.Add("multi_step", &multi_step, "control steps that a transition's rewards are summed over", AtLeast(1));
  fields.Add("eval_interval", &eval_interval, "control steps between evaluations", AtLeast(1));
  fields.Add("eval_episodes", &eval_episodes, "episodes per evaluation", EpisodeCounts());
  fields.AddChoice("keep", &keep, "which policy training returns: the best evaluated one, or the last",
                   KeptPolicyNames());
  fields.Add("average_over", &average_over,
             "gradient steps over which the policy that is evaluated and kept is averaged; 1: none", AtLeast(1));
  fields.Add(
      "n_starts", &n_starts,
      "agents that begin, of which the one with the highest return after start_steps goes on; one where n_steps is "
      "no more than start_steps",
      AtLeast(1));
  fields.Add("start_steps", &start_steps, "control steps of each of n_starts agents until one is chosen", AtLeast(1));
}

void ReplayConfig::CheckLearns(std::string_view section) const {
  const bool chooses = n_starts > 1 && start_steps < n_steps;
  for (const auto& [name, steps] : {std::pair{"n_steps", n_steps}, {"start_steps", chooses ? start_steps : n_steps}}) {
    if (learning_starts <= steps) continue;
    throw UsageError(
        fmt::format("{0}.{1} is {2}, which is over before the first gradient step after {0}.learning_starts = {3} "
                    "control steps; raise the former or lower the latter",
                    section, name, steps, learning_starts));
  }
  // As EndStep counts: the lanes' step that reaches learning_starts owes its gradient steps, too.
  const int64_t learned_from = (chooses ? start_steps : n_steps) - learning_starts + n_lanes;
  if (static_cast<double>(learned_from) * updates_per_step < 1) {
    throw UsageError(
        fmt::format("{0}.updates_per_step is {1}, which makes no gradient step in the {2} control steps "
                    "after {0}.learning_starts; raise it",
                    section, updates_per_step, learned_from));
  }
  for (const auto& [name, steps] :
       {std::pair{"eval_interval", eval_interval}, {"start_steps", chooses ? start_steps : eval_interval}}) {
    if (n_lanes <= steps) continue;
    throw UsageError(
        fmt::format("{0}.n_lanes is {1}, more than the control steps until a policy is looked at "
                    "({0}.{2} = {3}); lower the former or raise the latter",
                    section, n_lanes, name, steps));
  }
  if (batch_size > buffer_size) {
    throw UsageError(
        fmt::format("{0}.batch_size is {1}, more than the transitions kept ({0}.buffer_size = {2}); "
                    "lower the former or raise the latter",
                    section, batch_size, buffer_size));
  }
}

namespace {

/// Gradient steps between two steps of the averaged policy: all of them would cost a tenth of a small update.
constexpr int64_t kAverageEvery = 8;

Normalizer IdentityNormalizer(int dim) {
  return {std::vector<double>(static_cast<size_t>(dim), 0.0), std::vector<double>(static_cast<size_t>(dim), 1.0)};
}

/// The state of one training run between segments, and its segment.
class ReplayTraining : public Learner {
 public:
  ReplayTraining(const SimulatorFactory& factory, EpisodeSource& source, const ReplayConfig& config,
                 const std::string& algorithm, const MakeReplayUpdate& make_update, RngKey key, int n_threads)
      : config_(config),
        algorithm_(algorithm),
        source_(source),
        n_threads_(n_threads),
        lanes_(factory, source, config.n_lanes, n_threads),
        spec_(factory.spec()),
        rng_(key.Stage("training").MakeRng()),
        buffer_(spec_.obs_dim(), spec_.act_dim, std::min(config.buffer_size, config.n_steps + config.n_lanes)),
        rows_(config.n_lanes, config.multi_step, config.gamma, buffer_),
        observations_(static_cast<size_t>(config.n_lanes) * static_cast<size_t>(spec_.obs_dim())),
        actions_(static_cast<size_t>(config.n_lanes) * static_cast<size_t>(spec_.act_dim)) {
    if (config.normalize_observations) statistics_.emplace(spec_.obs_dim());
    Rng init = key.Stage("initialisation").MakeRng();
    TanhGaussianPolicy actor(IdentityNormalizer(spec_.obs_dim()), config.hidden, spec_.action_low, spec_.action_high);
    update_ = make_update(std::move(actor), init);
  }

  int64_t n_steps() const override { return n_steps_; }
  const EpisodeStatistics& episodes() const override { return lanes_.episodes(); }

  /// The actor's, then the normaliser's mean and scale where there is one.
  std::vector<float> PolicyParameters() const override {
    const std::span<const float> net = ActingNet();
    std::vector<float> parameters(net.begin(), net.end());
    if (statistics_) {
      for (const auto* values : {&statistics_->normalizer().mean, &statistics_->normalizer().scale}) {
        for (const double value : *values) parameters.push_back(static_cast<float>(value));
      }
    }
    return parameters;
  }

  TanhGaussianPolicy PolicyOf(std::span<const float> parameters) const {
    const auto net = parameters.first(update_->actor().net().parameters().size());
    const auto rest = parameters.subspan(net.size());
    Normalizer normalizer = IdentityNormalizer(spec_.obs_dim());
    if (statistics_) {
      const auto mean = rest.first(rest.size() / 2), scale = rest.last(rest.size() / 2);
      normalizer = {{mean.begin(), mean.end()}, {scale.begin(), scale.end()}};
    }
    TanhGaussianPolicy policy(std::move(normalizer), config_.hidden, spec_.action_low, spec_.action_high);
    std::ranges::copy(net, policy.net().parameters().begin());
    return policy;
  }
  std::unique_ptr<Policy> MakePolicy(std::span<const float> parameters) const override {
    return std::make_unique<TanhGaussianPolicy>(PolicyOf(parameters));
  }

  std::vector<std::pair<std::string, double>> Losses() const override {
    std::vector<std::pair<std::string, double>> figures = {{"train/critic_loss", losses_.critic_loss},
                                                           {"train/actor_loss", losses_.actor_loss},
                                                           {"train/ent_coef", losses_.alpha},
                                                           {"train/ent_coef_loss", losses_.alpha_loss}};
    for (auto& figure : source_.Figures()) figures.push_back(std::move(figure));
    return figures;
  }

  void RunSegment(int64_t end, const std::function<void()>& tick) override {
    lanes_.BeginSegment(rng_);
    PolicyRunner runner(update_->actor(), ActionNoise::kSampled);
    const auto step_lanes = [&] { lanes_.Step(actions_); };
    while (n_steps_ < end) {
      Act(runner);
      if (StepsBeside()) {
        // A thread of its own only where there is something to do meanwhile.
        const bool on_thread = n_threads_ > 1 && owed_updates_ >= 1;
        auto step = std::async(on_thread ? std::launch::async : std::launch::deferred, step_lanes);
        Learn(tick);
        step.get();
        EndStep();
      } else {
        step_lanes();
        EndStep();
        Learn(tick);
      }
    }
    // A checkpoint holds whole rows alone.
    for (const int lane : lanes_.all()) rows_.Cut(lane);
    Learn(tick);  // what the last step still owes
  }

  void Save(NpzArrays& arrays) override {
    update_->Save(arrays);
    source_.Save(arrays);
    lanes_.Save(arrays);
    if (statistics_) statistics_->Save(arrays);
    arrays["buffer/rows"] = NpyArray(std::vector<float>(buffer_.rows().begin(), buffer_.rows().end()));
    arrays["counters"] = NpyArray(std::vector<int64_t>{n_steps_, n_updates_, buffer_.next()});
    if (!average_.empty()) arrays["average"] = NpyArray(average_);
    arrays["owed_updates"] = NpyArray(std::vector<double>{owed_updates_});
    arrays["rng"] = RngArray(rng_);
  }

  void Restore(const NpzArrays& arrays) override {
    update_->Restore(arrays);
    source_.Restore(arrays);
    lanes_.Restore(arrays);
    if (statistics_) statistics_->Restore(arrays);
    const auto& counters = CheckpointValues<int64_t>(arrays, "counters", 3);
    n_steps_ = counters[0];
    n_updates_ = counters[1];
    buffer_.Restore(std::get<std::vector<float>>(arrays.at("buffer/rows").values), counters[2]);
    if (Averages() && n_updates_ > 0) {
      average_ = CheckpointValues<float>(arrays, "average", update_->actor().net().parameters().size());
    }
    owed_updates_ = CheckpointValues<double>(arrays, "owed_updates", 1)[0];
    RestoreRng(arrays, "rng", rng_);
  }

 private:
  /// Whether lanes step while the learner learns. The number of threads has no say: bytes do not depend on it.
  bool StepsBeside() const { return config_.n_lanes > 1; }

  /// Fills observations_ and actions_ for the next step of all lanes.
  void Act(PolicyRunner& runner) {
    const size_t obs_dim = static_cast<size_t>(spec_.obs_dim()), act_dim = static_cast<size_t>(spec_.act_dim);
    for (const int lane : lanes_.all()) {
      std::ranges::copy(lanes_.simulator().observation(lane),
                        observations_.begin() + static_cast<ptrdiff_t>(static_cast<size_t>(lane) * obs_dim));
    }
    if (statistics_) statistics_->Add(observations_);
    if (n_steps_ < config_.learning_starts) {
      for (size_t i = 0; i < actions_.size(); ++i) {
        actions_[i] = rng_.Uniform(spec_.action_low[i % act_dim], spec_.action_high[i % act_dim]);
      }
      return;
    }
    if (statistics_) {
      runner.Act(statistics_->Normalized(observations_), config_.n_lanes, rng_, actions_);
    } else {
      runner.Act(observations_, config_.n_lanes, rng_, actions_);
    }
    CheckStillLearns(std::reduce(actions_.begin(), actions_.end()), algorithm_, config_.learning_rate, n_steps_);
  }

  /// Keeps what the lanes' step came to, and begins episodes anew where they ended.
  void EndStep() {
    const size_t obs_dim = static_cast<size_t>(spec_.obs_dim()), act_dim = static_cast<size_t>(spec_.act_dim);
    std::vector<double> squashed(act_dim);
    const Simulator& simulator = lanes_.simulator();
    for (const int i : lanes_.all()) {
      const size_t lane = static_cast<size_t>(i);
      const LaneStatus status = simulator.status(i);
      if (status != LaneStatus::kDiverged) {
        for (size_t j = 0; j < act_dim; ++j) {
          const double low = spec_.action_low[j], high = spec_.action_high[j];
          squashed[j] = (2 * actions_[lane * act_dim + j] - low - high) / (high - low);
        }
        rows_.Add(i, {observations_.data() + lane * obs_dim, obs_dim}, squashed, simulator.reward(i),
                  simulator.observation(i), status == LaneStatus::kTerminated);
      }
      if (status != LaneStatus::kRunning) {
        rows_.Cut(i);
        lanes_.Next(i, rng_);
      }
    }
    n_steps_ += config_.n_lanes;
    if (n_steps_ >= config_.learning_starts && buffer_.size() > 0) {
      owed_updates_ += config_.updates_per_step * config_.n_lanes;
    }
  }

  /// The gradient steps that are owed.
  void Learn(const std::function<void()>& tick) {
    for (; owed_updates_ >= 1; owed_updates_ -= 1) {
      buffer_.Sample(config_.batch_size, rng_, batch_);
      if (statistics_) statistics_->Normalize(batch_);
      losses_ = update_->Step(batch_);
      CheckStillLearns(losses_.critic_loss + losses_.actor_loss + losses_.alpha, algorithm_, config_.learning_rate,
                       n_steps_);
      if (Averages() && n_updates_ % kAverageEvery == 0) Average();
      if (++n_updates_ % 256 == 0) tick();
    }
  }

  bool Averages() const { return config_.average_over > 1; }

  void Average() {
    const auto& net = update_->actor().net().parameters();
    if (average_.empty()) average_.assign(net.begin(), net.end());
    const double share = static_cast<double>(kAverageEvery) / static_cast<double>(config_.average_over);
    // A mean over what there was until it is as long as it should be.
    const double begun = 1.0 / (1.0 + static_cast<double>(n_updates_ / kAverageEvery));
    const float rate = static_cast<float>(std::min(1.0, std::max(share, begun)));
    for (size_t i = 0; i < average_.size(); ++i) average_[i] += rate * (net[i] - average_[i]);
  }

  /// Of the policy that is evaluated and kept.
  std::span<const float> ActingNet() const {
    if (average_.empty()) return update_->actor().net().parameters();
    return average_;
  }

  const ReplayConfig& config_;
  const std::string& algorithm_;
  EpisodeSource& source_;
  int n_threads_;
  TrainingLanes lanes_;
  const SimulatorSpec& spec_;
  Rng rng_;
  ReplayBuffer buffer_;
  MultiStepRows rows_;
  std::optional<ObservationStatistics> statistics_;
  std::unique_ptr<ReplayUpdate> update_;
  TransitionBatch batch_;
  ReplayLosses losses_;
  std::vector<float> average_;  ///< of the actor's parameters; empty where they are not averaged
  int64_t n_steps_ = 0, n_updates_ = 0;
  double owed_updates_ = 0;
  std::vector<double> observations_, actions_;  ///< (n_lanes, .), of the present step
};

}  // namespace

ReplayAgent TrainByReplay(const AgentJob& job, const ReplayConfig& config, const std::string& algorithm,
                          const MakeReplayUpdate& make_update) {
  const SimulatorSpec& spec = job.factory.spec();
  if (spec.n_discrete_actions > 0) {
    throw UsageError(
        fmt::format("task '{}' has discrete actions, {} takes continuous ones alone", spec.task, algorithm));
  }
  config.CheckLearns(algorithm);
  const TrainingSchedule schedule = {config.n_steps, config.eval_interval, config.eval_episodes, config.keep};
  AgentJob chosen = job;
  chosen.steps_beside = ChooseStart(
      job, schedule, {config.n_starts, config.start_steps}, [&](EpisodeSource& source, RngKey key, int n_threads) {
        return std::make_unique<ReplayTraining>(job.factory, source, config, algorithm, make_update, key, n_threads);
      });
  ReplayTraining training(job.factory, job.source, config, algorithm, make_update, job.key, job.context.n_threads);
  ReplayAgent result;
  static_cast<LearningCurve&>(result) = TrainInSegments(training, chosen, schedule);
  result.policy = training.PolicyOf(result.kept);
  return result;
}

}  // namespace oted
