#pragma once
/// Square rooms with obstacles in which a path leads from the top left cell to the bottom right one: how many there
/// are, how probable they are, and how to draw one. Exact, by a sweep over the cells that keeps which cells of the
/// sweep's edge are connected (a transfer matrix), so that no probability here is a Monte Carlo estimate.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "oted/base/rng.h"

namespace oted::minigrid {

/// What is known of one cell of the room.
enum class CellFact : int8_t { kFree = 0, kObstacle = 1, kUnknown = 2 };

/// Whether a path of free cells leads from the first to the last cell of a side x side room, moving in four directions.
/// `obstacles` is row-major, not 0 where there is one; side <= 32.
bool IsSolvable(int side, std::span<const uint8_t> obstacles);

/// The cells of a side x side room are row-major; start and goal are never obstacles and are not counted.
class SolvableGrids {
 public:
  static constexpr int kMaxSide = 10;

  /// side in [2, kMaxSide]. Milliseconds for a side of 8, half a second for 10. @throws UsageError
  explicit SolvableGrids(int side);
  /// One that lives as long as the program, made at the first call with this side. Thread-safe.
  static const SolvableGrids& Of(int side);

  int side() const { return side_; }
  int n_free() const { return side_ * side_ - 2; }

  /// The number of solvable rooms with k obstacles, k = 0, ..., n_free (to a relative 1e-13).
  const std::vector<double>& counts() const { return counts_; }
  /// The number of solvable rooms that agree with `facts` (side^2) and have k obstacles among the unknown cells,
  /// k = 0, ..., number of unknown cells. All zero when the facts rule out a path.
  std::vector<double> Completions(std::span<const CellFact> facts) const;

  /// P(solvable) when each free cell is an obstacle with probability `density`.
  double Acceptance(double density) const;
  /// The mean share of obstacles among the free cells of solvable rooms.
  double MeanRealisedDensity(double density) const;
  /// Draws a room from the Bernoulli distribution given that it is solvable, whatever its probability. density < 1.
  /// @param obstacles (side^2), overwritten
  void Sample(double density, Rng& rng, std::span<uint8_t> obstacles) const;

 private:
  static constexpr int32_t kDead = -1;  // no path can lead from start to goal any more
  // Of each state before a cell: the state after it when the cell is free, and when it is an obstacle.
  using Layer = std::vector<std::array<int32_t, 2>>;

  bool IsEnd(size_t cell) const { return cell == 0 || cell + 1 == layers_.size(); }
  size_t n_states(size_t cell) const { return cell < layers_.size() ? layers_[cell].size() : 1; }

  int side_;
  std::vector<Layer> layers_;  // one per cell
  std::vector<double> counts_;
};

/// log sum_k counts[k] z^k (1 - z)^(n - k) with n = counts.size() - 1; -inf where that is 0.
double LogMixture(std::span<const double> counts, double z);

}  // namespace oted::minigrid
