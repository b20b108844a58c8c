#pragma once
/// Logged transitions as the replay of an offline learner.

#include <vector>

#include "oted/base/array2.h"
#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/data/normalizer.h"
#include "oted/sim/simulator.h"

namespace oted {

/// A mini-batch of B logged transitions, and what was done next.
struct OfflineBatch {
  int size = 0;                       ///< B
  AlignedVector<float> observations;  ///< (2B, obs_dim): s of all rows, then s' of all rows
  AlignedVector<float> joint;         ///< (B, obs_dim + act_dim): [s, a], a in [-1, 1]
  AlignedVector<float> rewards;       ///< (B)
  AlignedVector<float> terminated;    ///< (B), 1 where s' has no value; 0 also for time limits
  AlignedVector<float> next_actions;  ///< (B, act_dim) in [-1, 1]: the logged a'; 0 where there is none
  AlignedVector<float> noise;         ///< (2B, act_dim) standard normals for the actions at s and at s'
};

/// Rows that a learner may learn from.
enum class OfflineRowChoice {
  kAll,             ///< a time limit is no end: its row's target bootstraps from s'
  kWithNextAction,  ///< those after which an action was logged, and terminal ones
};

class OfflineRows {
 public:
  /// @param normalizer  of the observations
  /// @param among       rows to choose from; empty: all
  /// @throws DataError where the dataset has no rewards, or no row that `choice` allows
  OfflineRows(const Dataset& dataset, const SimulatorSpec& spec, const Normalizer& normalizer, OfflineRowChoice choice,
              const std::vector<int>& among = {});

  int size() const { return static_cast<int>(rows_.size() / row_); }
  /// Rows drawn uniformly with replacement, and standard normals.
  void Draw(int batch_size, Rng& rng, OfflineBatch& batch) const;

 private:
  size_t obs_dim_, act_dim_, row_;  // row: s, a, s', r, terminated, a'
  std::vector<float> rows_;
};

/// @throws DataError for logs without rewards
void CheckHasRewards(const Dataset& dataset);

/// An action of the spec's range on [-1, 1]; one from outside is clipped.
double ToUnitAction(const SimulatorSpec& spec, double action, int dimension);

}  // namespace oted
