#pragma once
/// What a simulator's lanes did, as a dataset: the logs that a target would have left.

#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/rollout.h"

namespace oted {

/// The precision in which observations and rewards are logged. Actions are logged as they were given.
enum class LogPrecision {
  kDouble,
  kFloat,  ///< rounded to float32, as D4RL's files hold them
};

/// Records the steps of RunEpisodes:
///   EpisodeRecorder recorder(n_lanes);
///   RunEpisodes(simulator, z, policy, key, recorder.Observer());
///   Dataset logs = recorder.Logs();
class EpisodeRecorder {
 public:
  /// @param has_reward  false leaves the rewards of a task without any out of the log
  explicit EpisodeRecorder(int n_lanes, LogPrecision precision = LogPrecision::kDouble, bool has_reward = true)
      : precision_(precision), has_reward_(has_reward), lanes_(static_cast<size_t>(n_lanes)) {}

  /// Refers to this object, which must outlive it.
  StepObserver Observer();
  /// The lanes' episodes one after the other. A diverged step is left out, and the step before it is a timeout: the
  /// episode was cut there.
  Dataset Logs() const;
  /// Episodes that ended in a diverged step.
  int n_diverged() const { return n_diverged_; }

 private:
  void Record(const StepView& step);
  LogPrecision precision_;
  bool has_reward_;
  std::vector<Dataset> lanes_;
  int n_diverged_ = 0;
};

}  // namespace oted
