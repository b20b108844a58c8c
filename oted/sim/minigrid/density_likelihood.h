#pragma once
/// The yardstick of the density's design: what an estimator can know that sees what the demonstrations show.
///
/// One episode shows some cells of its room (`facts`), and the room was drawn until it was solvable. With s obstacles
/// among the seen free cells and c_k completions of the unseen ones with k obstacles that leave a path,
///
///   P(facts | z, solvable) = sum_k c_k z^(s + k) (1 - z)^(n - s - k) / sum_k N_k z^k (1 - z)^(n - k),
///
/// both sums exact (solvable_grids.h): the unseen cells count through the path that there must be. Placement by count
/// has c_(K - s) / N_K with K = round(z n). The one approximation: which cells were seen, and what an expert did who
/// sees the whole room, are taken to tell nothing about the cells that were not seen.

#include <memory>
#include <span>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/minigrid/solvable_grids.h"
#include "oted/sim/minigrid/task.h"

namespace oted {

/// What one episode of a kObstacles task shows of its room, (size - 2)^2 cells row by row. The agent starts at (1, 1)
/// looking right; its place follows from the actions and from what stood in front of it. With moving balls the first
/// observation alone counts, since later ones do not show where they started.
/// @throws DataError when observations and actions contradict each other or the task
std::vector<minigrid::CellFact> SeenCells(const MinigridTask& task, const Dataset& data, const Episode& episode);

/// A density with the spread that the likelihood gives it.
struct DensityEstimate {
  double density = 0;
  double log_likelihood = 0;  ///< [nats]
  double standard_error = 0;  ///< 1 / sqrt(observed information); infinite at a bound and where the data say nothing
};

class DensityLikelihood {
 public:
  /// Of a kObstacles task. @throws UsageError when its room is solvable and larger than SolvableGrids::kMaxSide.
  explicit DensityLikelihood(const MinigridTask& task);

  /// Adds what one episode shows. @throws DataError when no solvable room looks like this.
  void Add(std::span<const minigrid::CellFact> facts);
  /// Adds every episode of a dataset of the task's observations.
  void Add(const Dataset& data);

  int n_episodes() const { return n_episodes_; }
  int n_seen() const { return n_seen_; }                      ///< cells, over all episodes
  int n_obstacles_seen() const { return n_obstacles_seen_; }  ///< of them

  /// log P(all that was added | z) [nats]; -inf where it cannot be. z in [0, 1).
  double LogLikelihood(double z) const;
  /// The multiple of `step` in [low, high] with the highest likelihood; the lower one of equals.
  DensityEstimate MaximumOnGrid(double low, double high, double step = 0.05) const;
  /// The density in [low, high] with the highest likelihood, to 1e-6 (to 1e-3 with placement by count, which has
  /// steps).
  DensityEstimate Maximum(double low, double high) const;

 private:
  DensityEstimate EstimateAt(double z, double low, double high) const;

  MinigridTask task_;
  const minigrid::SolvableGrids* grids_ = nullptr;  // null when grids need not be solvable
  int n_episodes_ = 0, n_seen_ = 0, n_obstacles_seen_ = 0;
  // Of the episodes whose likelihood is more than that of the seen cells one by one: obstacles seen, and completions by
  // the number of obstacles among the unseen cells.
  struct Seen {
    int obstacles;
    std::vector<double> completions;
  };
  std::vector<Seen> seen_;
};

}  // namespace oted
