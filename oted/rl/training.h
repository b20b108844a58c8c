#pragma once
/// What training an agent is, whatever the algorithm: segments of control steps, an evaluation after each, the policy
/// that is kept, checkpoints. Knows nothing of the design: where an episode's parameters come from is a callback.

#include <fmt/format.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/base/log.h"
#include "oted/data/npz.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Draws the parameters z of a new episode. Called from several threads.
using EpisodeParameters = std::function<std::vector<double>(Rng& rng)>;

/// Where an agent's episodes take place, told how they went: a curriculum depends on it. Called from one thread.
class EpisodeSource {
 public:
  virtual ~EpisodeSource() = default;
  /// Another one, as this one is now.
  virtual std::unique_ptr<EpisodeSource> Clone() const = 0;
  /// z of the episode that begins in `lane`.
  virtual std::vector<double> Draw(int lane, Rng& rng) = 0;
  /// The episode that began in `lane` last is over.
  /// @param episode_return  undiscounted; of a diverged episode: up to there
  virtual void EpisodeEnded(int lane, double episode_return, bool diverged) {
    static_cast<void>(lane), static_cast<void>(episode_return), static_cast<void>(diverged);
  }
  /// Names and values for the log, as they are now.
  virtual std::vector<std::pair<std::string, double>> Figures() const { return {}; }
  /// What it holds between two segments; part of the agent's checkpoint. Restore may throw any std::exception.
  virtual void Save(NpzArrays& arrays) const { static_cast<void>(arrays); }
  virtual void Restore(const NpzArrays& arrays) { static_cast<void>(arrays); }
};

/// Episodes that do not depend on what came before.
class DrawnEpisodes : public EpisodeSource {
 public:
  explicit DrawnEpisodes(EpisodeParameters draw) : draw_(std::move(draw)) {}
  std::unique_ptr<EpisodeSource> Clone() const override { return std::make_unique<DrawnEpisodes>(*this); }
  std::vector<double> Draw(int, Rng& rng) override { return draw_(rng); }

 private:
  EpisodeParameters draw_;
};

/// Which policy training returns: the best evaluated one, or the last.
enum class KeptPolicy { kBest, kLast };
const NamedValues<KeptPolicy>& KeptPolicyNames();

/// Where gradient steps are made.
enum class TrainingDevice { kCpu, kCuda };
const NamedValues<TrainingDevice>& TrainingDeviceNames();

/// How long an agent trains and how it is looked at on the way.
struct TrainingSchedule {
  int64_t n_steps = 0;        ///< control steps over all lanes
  int64_t eval_interval = 0;  ///< of a segment, in control steps
  int eval_episodes = 0;
  KeptPolicy keep = KeptPolicy::kBest;
  ActionNoise noise = ActionNoise::kMean;  ///< how the policy acts where it is evaluated
};

/// What an evaluation found, as far as policies are compared by it.
struct EvaluatedReturn {
  double mean_return = 0;
  bool always_diverged = false;  ///< so did every episode: the return is no measure of a policy
  /// A policy that always diverged is below any other.
  bool IsBetterThan(const EvaluatedReturn& other) const {
    return always_diverged != other.always_diverged ? other.always_diverged : mean_return > other.mean_return;
  }
};

/// What training gave, beside the policy itself.
struct LearningCurve {
  double eval_return = 0;            ///< mean return of the kept policy in the simulators it was evaluated in
  int n_diverged = 0;                ///< of that evaluation's episodes
  bool always_diverged = false;      ///< so did all of them
  std::vector<int64_t> eval_steps;   ///< environment steps ...
  std::vector<double> eval_returns;  ///< ... and the mean return there
  std::vector<float> kept;           ///< the kept policy's PolicyParameters
};

/// Undiscounted returns and lengths of the training episodes that ended since BeginSegment.
class EpisodeStatistics {
 public:
  explicit EpisodeStatistics(int n_lanes) : lanes_(static_cast<size_t>(n_lanes)) {}
  void BeginSegment();
  /// The lane's episode is none: it is cut, and counts nowhere.
  void Forget(int lane);
  void AddStep(int lane, double reward);
  /// @return the episode's return
  double EndEpisode(int lane);
  const std::vector<double>& returns() const { return returns_; }
  const std::vector<double>& lengths() const { return lengths_; }

 private:
  struct Running {
    double episode_return = 0, length = 0;
  };
  std::vector<Running> lanes_;
  std::vector<double> returns_, lengths_;
};

/// An algorithm at work on one agent. What it holds between two segments goes through Save and Restore.
class Learner {
 public:
  virtual ~Learner() = default;
  virtual int64_t n_steps() const = 0;
  /// All that the present policy is made of, as one flat vector.
  virtual std::vector<float> PolicyParameters() const = 0;
  /// The policy that is made of `parameters`, which were PolicyParameters once.
  virtual std::unique_ptr<Policy> MakePolicy(std::span<const float> parameters) const = 0;
  /// Trains until `end` control steps have been made; `tick` is called now and then.
  virtual void RunSegment(int64_t end, const std::function<void()>& tick) = 0;
  virtual const EpisodeStatistics& episodes() const = 0;
  /// Names and values for the log, of the last gradient step.
  virtual std::vector<std::pair<std::string, double>> Losses() const = 0;
  virtual void Save(NpzArrays& arrays) = 0;
  /// @throws std::exception of any kind where the arrays are not those of Save
  virtual void Restore(const NpzArrays& arrays) = 0;
};

/// Sees every evaluated policy in turn: a recorder of snapshots. `step` control steps had been made.
using EvaluationObserver = std::function<void(int64_t step, const Policy& policy, double eval_return)>;

/// One agent to train: where its episodes take place, and what becomes of it. What it refers to must outlive it.
struct AgentJob {
  const SimulatorFactory& factory;
  EpisodeSource& source;
  /// (n, parameters): the simulators in which its checkpoints are compared; episode k runs in row k mod n.
  std::vector<std::vector<double>> eval_parameters;
  RngKey key;
  std::filesystem::path folder;  ///< of this agent: checkpoint.npz while it trains
  std::string run_name;          ///< its learning curve's in the log
  RunContext context;
  EvaluationObserver observer = {};
  int64_t steps_beside = 0;  ///< control steps made beforehand by learners that were dropped; progress counts them
};

/// Trains for schedule.n_steps control steps. Each segment of eval_interval steps ends with an evaluation of the
/// policy; episodes go on through it. A checkpoint follows where a twentieth of the steps was made since the last one,
/// at the end and at a stop; a stopped run that goes on gives the same bytes as one that was not stopped. With more
/// than one thread the next segment does not wait for the evaluation. The kept policy is that of the highest mean
/// return (or the last); an evaluation in which every episode diverged is below any other.
/// @throws Interrupted at a segment's end when a stop was requested; DataError for a checkpoint that does not fit.
LearningCurve TrainInSegments(Learner& learner, const AgentJob& job, const TrainingSchedule& schedule);

/// For a learner after a gradient step: networks with a loss that is not finite do not recover.
/// @param losses  any sum of them
/// @throws DataError that names the algorithm's `section`, its learning rate and the control steps made until then
void CheckStillLearns(double losses, std::string_view section, double learning_rate, int64_t n_steps);

/// A checkpoint's array of `size` numbers, stored as T. @throws DataError
template <class T>
const std::vector<T>& CheckpointValues(const NpzArrays& arrays, const std::string& name, size_t size) {
  const auto found = arrays.find(name);
  const std::vector<T>* values = found == arrays.end() ? nullptr : std::get_if<std::vector<T>>(&found->second.values);
  if (values == nullptr || values->size() != size) throw DataError(fmt::format("no fitting array '{}'", name));
  return *values;
}

/// A random stream as an array, and back. @throws DataError
NpyArray RngArray(const Rng& rng);
void RestoreRng(const NpzArrays& arrays, const char* name, Rng& rng);

}  // namespace oted
