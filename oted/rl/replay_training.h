#pragma once
/// Training one agent from replayed transitions: what SAC and CrossQ have in common (Algorithm 2 of the paper, one
/// agent). They differ in the gradient step.

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "oted/base/fields.h"
#include "oted/base/log.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/rl/replay_buffer.h"
#include "oted/rl/training.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Defaults are Stable-Baselines3's except where noted, and where an algorithm has its own.
struct ReplayConfig {
  int64_t n_steps = 300'000;
  int n_lanes = 1;
  double updates_per_step = 1.0;
  int64_t learning_starts = 1'000;  ///< Stable-Baselines3: 100; rl-zoo's MuJoCo settings: 10,000
  int batch_size = 256;
  int64_t buffer_size = 1'000'000;
  std::vector<int> hidden = {256, 256};  ///< of the actor
  double learning_rate = 3e-4;
  double gamma = 0.99;
  int multi_step = 1;
  int64_t eval_interval = 10'000;
  int eval_episodes = 5;
  KeptPolicy keep = KeptPolicy::kBest;
  /// The policy that is evaluated and kept is a running mean of the learner's over about this many gradient steps; 1:
  /// the learner's own.
  int64_t average_over = 1;
  int n_starts = 1;              ///< agents that begin; the best goes on (oted/rl/starts.h)
  int64_t start_steps = 60'000;  ///< control steps of each
  /// Whether networks see observations in units of ObservationStatistics. A setting of SAC alone: CrossQ's networks
  /// begin with a batch normalisation.
  bool normalize_observations = false;
  /// Where gradient steps are made (oted/rl/autograd). Not a field: `[agents] device` names it.
  TrainingDevice device = TrainingDevice::kCpu;

  /// @throws UsageError, naming `section`, where training would end before its first gradient step, an episode after
  /// its first step, or a batch would be larger than what it is drawn from
  void CheckLearns(std::string_view section) const;

 protected:
  /// All but `hidden`, which networks it is of depends on the algorithm.
  void AddFields(FieldList& fields);
};

/// Means over the batch, as Stable-Baselines3 logs them.
struct ReplayLosses {
  double critic_loss = 0, actor_loss = 0, alpha = 0, alpha_loss = 0, mean_q = 0;
};

/// A learner's networks and its gradient step.
class ReplayUpdate {
 public:
  virtual ~ReplayUpdate() = default;
  virtual ReplayLosses Step(const TransitionBatch& batch) = 0;
  /// The policy as it acts now.
  virtual const TanhGaussianPolicy& actor() const = 0;
  /// All that it holds between two steps. Restore throws DataError naming the array that is missing or of another
  /// size; the caller names the file.
  virtual void Save(NpzArrays& arrays) = 0;
  virtual void Restore(const NpzArrays& arrays) = 0;
};

/// @param actor  the shape; weights are drawn from `rng`
using MakeReplayUpdate = std::function<std::unique_ptr<ReplayUpdate>(TanhGaussianPolicy actor, Rng& rng)>;

struct ReplayAgent : LearningCurve {
  TanhGaussianPolicy policy;
};

/// Trains one agent by TrainInSegments. Time limits and segment ends are not terminal: the target bootstraps through
/// them. One lane and its learner take turns, as in SAC's paper. Several lanes make their next step while the learner
/// makes the gradient steps that the last one owes, on a second thread where there is one: those gradient steps draw
/// from all transitions but the newest `n_lanes`, and the policy that acts is no older for it.
/// @param algorithm  its section of the configuration, for errors
/// @throws UsageError for a task with discrete actions, and as CheckLearns; as TrainInSegments
ReplayAgent TrainByReplay(const AgentJob& job, const ReplayConfig& config, const std::string& algorithm,
                          const MakeReplayUpdate& make_update);

}  // namespace oted
