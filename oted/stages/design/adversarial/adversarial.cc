#include "oted/stages/design/adversarial/adversarial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <optional>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/statistics.h"
#include "oted/data/checkpoint_curves.h"
#include "oted/stages/design/adversarial/joint_clone.h"

namespace oted {
namespace {

constexpr int kCheckpointInterval = 10;

/// Rows of simulator samples, by iteration and by z, that g is trained on.
class SampleReplay {
 public:
  explicit SampleReplay(int n_iterations) : capacity_(static_cast<size_t>(n_iterations)) {}

  void Add(std::vector<Array2<double>> by_lane) {
    std::erase_if(by_lane, [](const Array2<double>& rows) { return rows.rows() == 0; });
    if (by_lane.empty()) return;
    iterations_.push_back(std::move(by_lane));
    if (iterations_.size() > capacity_) iterations_.pop_front();
  }
  bool empty() const { return iterations_.empty(); }
  /// A sample balanced over z: first the z, then one of its rows.
  std::span<const double> Draw(Rng& rng) const {
    const auto& lanes = iterations_[rng.Below(iterations_.size())];
    const Array2<double>& rows = lanes[rng.Below(lanes.size())];
    return rows.row(static_cast<int>(rng.Below(static_cast<uint64_t>(rows.rows()))));
  }
  const std::deque<std::vector<Array2<double>>>& iterations() const { return iterations_; }

 private:
  size_t capacity_;
  std::deque<std::vector<Array2<double>>> iterations_;
};

/// The logs as g sees them. Where the clone acts from logged states, a row comes as often as a rollout of the logs'
/// behaviour from there would show it: the first rows of an episode are in fewer windows than others.
class LoggedSamples {
 public:
  /// @param windows  where rollouts begin; none: every row counts the same
  LoggedSamples(Array2<double> features, std::vector<LogWindow> windows)
      : features_(std::move(features)), windows_(std::move(windows)) {
    for (const LogWindow& window : windows_) longest_ = std::max(longest_, window.n_steps);
  }
  const Array2<double>& features() const { return features_; }
  std::span<const double> Draw(Rng& rng) const {
    if (windows_.empty()) return features_.row(static_cast<int>(rng.Below(static_cast<uint64_t>(features_.rows()))));
    while (true) {
      const LogWindow& window = windows_[rng.Below(windows_.size())];
      const int step = static_cast<int>(rng.Below(static_cast<uint64_t>(longest_)));
      if (step < window.n_steps) return features_.row(window.begin + step);
    }
  }

 private:
  Array2<double> features_;
  std::vector<LogWindow> windows_;
  int longest_ = 0;
};

double RewardOf(double logit, DesignReward kind) {
  return kind == DesignReward::kLogRatio ? logit : MinusLogOneMinusG(logit);
}

/// Lines 2: the mean reward of each z; diverged or empty ones get the lowest of the others.
std::vector<double> Rewards(const std::vector<LaneExperience>& experience, Discriminator& g, DesignReward kind) {
  std::vector<double> rewards(experience.size(), std::numeric_limits<double>::quiet_NaN());
  double lowest = std::numeric_limits<double>::infinity();
  for (size_t k = 0; k < experience.size(); ++k) {
    if (experience[k].diverged || experience[k].features.rows() == 0) continue;
    double sum = 0;
    for (const double logit : g.Logits(experience[k].features)) sum += RewardOf(logit, kind);
    rewards[k] = sum / experience[k].features.rows();
    lowest = std::min(lowest, rewards[k]);
  }
  if (std::isinf(lowest)) lowest = 0;
  for (double& reward : rewards) {
    if (std::isnan(reward)) reward = lowest;
  }
  return rewards;
}

/// (R - mean) / std: the policy gradient's baseline, and a scale that does not depend on how sure g is.
std::vector<double> Standardize(const std::vector<double>& rewards, double floor) {
  const double n = static_cast<double>(rewards.size());
  double mean = 0, variance = 0;
  for (const double r : rewards) mean += r / n;
  for (const double r : rewards) variance += (r - mean) * (r - mean) / n;
  // Equal rewards carry no information: rounding noise must not be blown up into some.
  const double scale = std::max(std::sqrt(variance), floor);
  std::vector<double> advantages;
  for (const double r : rewards) advantages.push_back((r - mean) / scale);
  return advantages;
}

/// What Algorithm 1 carries from one iteration to the next.
struct DesignState {
  Designer q;
  Discriminator g;
  SampleReplay replay;
  int iteration = 0;
  double progress_sum = 0;
  std::vector<double> state_sum;  // of q.State() over the iterations that are averaged; empty before them
  int n_averaged = 0;

  void AddToAverage() {
    const std::vector<double> now = q.State();
    state_sum.resize(now.size(), 0.0);
    for (size_t i = 0; i < now.size(); ++i) state_sum[i] += now[i];
    ++n_averaged;
  }
  /// To the mean of the iterations' states.
  void Average() {
    std::vector<double> mean;
    for (const double sum : state_sum) mean.push_back(sum / n_averaged);
    q.SetState(mean);
  }

  void Save(const std::filesystem::path& path, JointClone* joint, const DesignProblem& problem) const {
    NpzArrays arrays;
    KeepCurvesMark(*problem.context.log, problem.run_name, arrays);
    if (joint != nullptr) joint->Save(arrays);
    g.Save(arrays);
    arrays["q/state"] = NpyArray(q.State());
    arrays["q/state_sum"] = NpyArray(state_sum);
    arrays["counters"] =
        NpyArray(std::vector<double>{static_cast<double>(iteration), progress_sum, static_cast<double>(n_averaged)});
    for (size_t i = 0; i < replay.iterations().size(); ++i) {
      const auto& lanes = replay.iterations()[i];
      for (size_t k = 0; k < lanes.size(); ++k) arrays[fmt::format("replay/{:03}/{:05}", i, k)] = NpyArray(lanes[k]);
    }
    WriteCheckpoint(arrays, path);
  }

  void Restore(const std::filesystem::path& path, JointClone* joint, const DesignProblem& problem) {
    const NpzArrays arrays = ReadCheckpoint(path);
    if (joint != nullptr) joint->Restore(arrays, path.string());
    g.Restore(arrays, path.string());
    q.SetState(arrays.at("q/state").ToDouble());
    state_sum = arrays.at("q/state_sum").ToDouble();
    iteration = static_cast<int>(arrays.at("counters").ToDouble().at(0));
    progress_sum = arrays.at("counters").ToDouble().at(1);
    n_averaged = static_cast<int>(arrays.at("counters").ToDouble().at(2));
    // Names sort by iteration, then lane.
    std::vector<Array2<double>> lanes;
    std::string current;
    for (const auto& [name, array] : arrays) {
      if (!name.starts_with("replay/")) continue;
      const std::string group = name.substr(0, 10);
      if (group != current && !lanes.empty()) replay.Add(std::exchange(lanes, {}));
      current = group;
      Array2<double> rows(static_cast<int>(array.shape.at(0)), static_cast<int>(array.shape.at(1)));
      const std::vector<double> values = array.ToDouble();
      std::copy(values.begin(), values.end(), rows.data());
      lanes.push_back(std::move(rows));
    }
    if (!lanes.empty()) replay.Add(std::move(lanes));
    GoOnWithCurves(*problem.context.log, problem.run_name, arrays);
  }
};

/// Line 4. Returns means over the steps.
Discriminator::StepResult UpdateDiscriminator(const DiscriminatorConfig& config, const LoggedSamples& logged, Rng& rng,
                                              DesignState& state) {
  Discriminator::StepResult mean;
  if (state.replay.empty()) return mean;
  const int batch = config.batch;
  const int width = logged.features().cols();
  Array2<double> data_rows(batch, width), sim_rows(batch, width);
  for (int step = 0; step < config.steps; ++step) {
    for (int i = 0; i < batch; ++i) {
      const auto data_row = logged.Draw(rng);
      std::copy(data_row.begin(), data_row.end(), data_rows.row(i).begin());
      const auto sim_row = state.replay.Draw(rng);
      std::copy(sim_row.begin(), sim_row.end(), sim_rows.row(i).begin());
    }
    const Discriminator::StepResult result = state.g.Step(data_rows, sim_rows);
    mean.loss += result.loss / config.steps;
    mean.accuracy += result.accuracy / config.steps;
  }
  return mean;
}

void LogIteration(const DesignState& state, const std::vector<double>& rewards,
                  const Discriminator::StepResult& discriminator, int n_iterations, const std::string& run_name,
                  LogSink& log) {
  const std::vector<double> mode = state.q.Mode(), std = state.q.Std();
  log.Scalar(run_name, "design/reward", state.iteration, Mean(rewards));
  log.Scalar(run_name, "design/discriminator_loss", state.iteration, discriminator.loss);
  log.Scalar(run_name, "design/discriminator_accuracy", state.iteration, discriminator.accuracy);
  log.Scalar(run_name, "design/kl", state.iteration, state.q.KlToPrior());
  std::string note = fmt::format("R {:.3f}", Mean(rewards));
  for (int i = 0; i < state.q.size(); ++i) {
    const std::string& name = state.q.space()[i].name;
    const size_t at = static_cast<size_t>(i);
    log.Scalar(run_name, "design/mode/" + name, state.iteration, mode[at]);
    log.Scalar(run_name, "design/std/" + name, state.iteration, std[at]);
    if (i < 4) note += fmt::format("  {} {:.2f}+-{:.2f}", name, mode[at], std[at]);
  }
  log.Progress("design", run_name, state.iteration, n_iterations, note);
}

}  // namespace

DesignResult LearnAdversarially(const DesignProblem& problem, const AdversarialConfig& config,
                                const DiscriminatorConfig& discriminator, const Designer& start) {
  const auto& [factory, dataset, given_clone, key, folder, run_name, context, unused_judged] = problem;
  const Policy* clone = given_clone;
  EvidenceConfig evidence = config.Evidence(factory.spec());
  std::optional<JointClone> joint;
  if (config.clone_updates > 0) {
    joint.emplace(dynamic_cast<const TanhGaussianPolicy&>(*clone), dataset, config, key.Stage("joint clone"));
    clone = &joint->policy();
    evidence.keep_steps = true;
  }
  ExperienceGatherer gatherer(factory.Make(config.n_sims, context.n_threads), dataset, clone, evidence);
  // A stack has rows of its own, and replays need no weights: there g compares what follows a row with the row.
  const bool weighted = !evidence.replayed_actions && evidence.stack == 1;
  const LoggedSamples logged(DatasetFeatures(dataset, evidence),
                             weighted ? gatherer.windows() : std::vector<LogWindow>());

  Rng init = key.Stage("initialisation").MakeRng();
  DesignState state{start,
                    Discriminator(logged.features(), discriminator, init, FeatureShape(factory.spec(), evidence)),
                    SampleReplay(config.replay_iterations),
                    0,
                    0,
                    {},
                    0};
  const std::filesystem::path checkpoint = folder / "checkpoint.npz";
  if (std::filesystem::exists(checkpoint)) state.Restore(checkpoint, joint ? &*joint : nullptr, problem);

  while (state.iteration < config.n_iterations) {
    const RngKey iteration_key = key.Stage("iteration").Index(static_cast<uint64_t>(state.iteration));
    Rng rng = iteration_key.MakeRng();

    // 1: gather experience E with z_k ~ q.
    const std::vector<Designer::Sample> draws = state.q.DrawBatch(config.n_sims, rng);
    std::vector<std::vector<double>> z;
    for (const Designer::Sample& draw : draws) z.push_back(draw.z);
    std::vector<LaneExperience> experience = gatherer.Gather(z, iteration_key.Stage("rollouts"));

    // 2: estimate the discriminator's output on it, before g is updated.
    const std::vector<double> rewards = Rewards(experience, state.g, config.reward);
    // Of one kind for all settings, so that these compare.
    state.progress_sum += config.reward == DesignReward::kPaper
                              ? Mean(rewards)
                              : Mean(Rewards(experience, state.g, DesignReward::kPaper));

    // 3: update q. In the first iteration g is still blind and its rewards are noise.
    if (state.iteration > 0) {
      state.q.Ascend(draws, Standardize(rewards, config.reward_floor),
                     {.lambda = config.lambda, .mean = config.step_mean, .log_std = config.step_log_std});
    }

    // 4: update g on (E, D).
    if (joint) joint->Add(experience);
    std::vector<Array2<double>> by_lane;
    for (LaneExperience& lane : experience) by_lane.push_back(std::move(lane.features));
    state.replay.Add(std::move(by_lane));
    const Discriminator::StepResult step = UpdateDiscriminator(discriminator, logged, rng, state);

    // 5: update the clone. In the first iteration its critic is blind.
    if (joint) {
      Rng of_clone = iteration_key.Stage("clone updates").MakeRng();
      const double objective = joint->Update(of_clone, state.iteration > 0);
      context.log->Scalar(run_name, "design/clone_objective", state.iteration + 1, objective);
    }

    ++state.iteration;
    if (state.iteration > (1 - config.average) * config.n_iterations) state.AddToAverage();
    LogIteration(state, rewards, step, config.n_iterations, run_name, *context.log);
    if (context.StopRequested() || state.iteration % kCheckpointInterval == 0) {
      state.Save(checkpoint, joint ? &*joint : nullptr, problem);
    }
    context.ThrowIfStopped();
  }
  if (state.n_averaged > 0) state.Average();
  DesignResult result{.q = state.q, .g = state.g, .learning_progress = state.progress_sum / config.n_iterations};
  if (joint) result.clone = joint->policy();
  return result;
}

}  // namespace oted
