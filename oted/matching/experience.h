#pragma once
/// Samples of the two distributions that the design matches (paper, Sec. 4.1): experience E, gathered in M(z) for a
/// batch of parameters z (Algorithm 1, line 1), and the dataset's own transitions in the same features.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/dataset.h"
#include "oted/nn/encoder.h"
#include "oted/nn/policy.h"
#include "oted/sim/log_window.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Which evidence tells simulator and dataset apart.
struct EvidenceConfig {
  bool dataset_starts = true;    ///< rollouts begin at logged states; otherwise at the initial distribution
  bool replayed_actions = true;  ///< the logged actions are replayed from there; otherwise the clone acts
  bool transitions = true;       ///< features (s, a, s' - s); otherwise (s, a)
  bool actions = true;       ///< false: features s alone; the first thing that a poor clone gets wrong is its actions
  int horizon = 10;          ///< control steps per rollout, before the next start
  int n_steps = 60;          ///< control steps per z and batch
  double clone_noise = 1.0;  ///< multiplies the clone's standard deviation
  /// Earlier actions that transition features show too, SimulatorSpec::n_past_actions: after a delay, s' - s is the
  /// work of actions before a, and without them g could not tell one delay from another.
  int n_past_actions = 0;
  /// The logged rows are the first `horizon` of each episode, as the rollouts are. Without settable states that is what
  /// compares like with like: the later a step, the more of what the clone does wrong has come together.
  bool first_rows = false;
  /// Samples are this many steps of a rollout, or of an episode from its start, side by side; what is left over at its
  /// end is no sample. The channels of their images lie side by side in one image.
  int stack = 1;
  /// Every lane of a batch gets the same starts and the same noise of the clone, so that lanes differ in z alone and
  /// their rewards can be compared; otherwise each has its own, as what learns from all of them wants.
  bool common_starts = true;
  std::vector<int> image = {};  ///< SimulatorSpec::image_shape, of one step
  bool keep_steps = false;      ///< LaneExperience::steps are kept
};

/// The dataset's rows that are compared with experience of that kind: (s, a) or (s, a, s' - s), the latter with the
/// `n_past_actions` actions before a, latest first, 0 before the episode's first.
Array2<double> DatasetFeatures(const Dataset& dataset, const EvidenceConfig& evidence);

/// What the numbers of an observation are.
InputShape ObservationShape(const SimulatorSpec& spec);
/// The same of features. @throws UsageError for transitions of images or indices, whose differences mean nothing
InputShape FeatureShape(const SimulatorSpec& spec, const EvidenceConfig& evidence);

/// The latest actions of one rollout.
class PastActions {
 public:
  /// None was taken yet.
  PastActions(int n_actions, int act_dim);
  void Clear();
  void Push(std::span<const double> action);
  /// (n_actions * act_dim), latest first.
  std::span<const double> values() const { return values_; }

 private:
  std::vector<double> values_;
};

/// Joins steps into samples (EvidenceConfig::stack).
class StepStack {
 public:
  explicit StepStack(const EvidenceConfig& evidence) : stack_(evidence.stack), image_(evidence.image) {}
  /// A rollout or an episode begins.
  void Clear() { steps_.clear(); }
  /// Adds one step's features; appends a sample to `samples` where it is the last one.
  void Push(std::span<const double> step, Array2<double>& samples);

 private:
  int stack_;
  std::vector<int> image_;
  std::vector<std::vector<double>> steps_;
};

/// Samples of one z.
struct LaneExperience {
  Array2<double> features;  ///< (up to n_steps, feature_dim): all valid steps
  bool diverged = false;    ///< the physics broke down at least once
  Dataset steps;            ///< every valid step, one episode per rollout; empty unless asked for
};

/// Gathers experience in a simulator whose lanes are the batch of z. Not thread-safe.
class ExperienceGatherer {
 public:
  /// @param dataset, clone  must outlive this object; `clone` may be null when actions are replayed.
  /// @throws DataError when the evidence needs settable states and the simulator or the data have none.
  ExperienceGatherer(std::unique_ptr<Simulator> simulator, const Dataset& dataset, const Policy* clone,
                     const EvidenceConfig& config);

  int n_lanes() const { return simulator_->n_lanes(); }
  /// Where rollouts from logged states begin, and for how long the log goes on from there. Empty where they begin at
  /// the initial distribution.
  const std::vector<LogWindow>& windows() const { return windows_; }

  /// `n_steps` control steps for each z[k], k < n_lanes. A rollout ends at its horizon, at termination (replayed
  /// actions go on: the log did) or divergence, and the next begins.
  std::vector<LaneExperience> Gather(const std::vector<std::vector<double>>& z, RngKey key);

 private:
  void StartRollout(int lane, int n_started, RngKey key);
  RngKey StartKey(int lane, RngKey key) const;
  LogWindow window(int lane, int n_started, RngKey key) const;
  int RolloutLength(int lane, int n_started, RngKey key) const;

  std::unique_ptr<Simulator> simulator_;
  const Dataset& dataset_;
  const Policy* clone_;
  EvidenceConfig config_;
  std::vector<LogWindow> windows_;         // those whose first state the simulator can be set to
  std::vector<PastActions> past_actions_;  // of each lane
  std::vector<StepStack> stacks_;          // of each lane
  std::vector<Rng> noise_;                 // of each lane: of the clone's actions in its rollout
};

}  // namespace oted
