#pragma once
/// Rates of change of logged readings that nobody measured, by local parabolas.

#include <array>
#include <map>
#include <vector>

#include "oted/data/dataset.h"

namespace oted {

/// How fast readings change about a logged row: the slope of a least-squares parabola through the readings around it,
/// as many as predict left-out readings best, none from beyond the episode.
class LocalRates {
 public:
  /// @param dataset   must outlive this object
  /// @param period_s  control period [s]
  LocalRates(const Dataset& dataset, double period_s);

  /// Of observation `column` at `row` [1/s].
  double Rate(int column, int row);
  /// Angular velocity about axis `axis` of a body whose quaternion (w, x, y, z) these observations show, in the body's
  /// own frame [rad/s]. q and -q are the same orientation.
  double TurnRate(const std::array<int, 4>& orientation, int axis, int row);
  /// Readings on either side that are fitted.
  int HalfWidth(int column);

 private:
  /// Readings about a row, the first and the last of them `before` and `behind` rows away.
  struct Around {
    std::vector<double> values;
    int before = 0;
  };
  Around ReadingsAround(int column, int row, int half_width) const;

  const Dataset& dataset_;
  double period_s_;
  std::vector<Episode> episode_of_;  // (rows)
  std::map<int, int> half_widths_;   // by column
};

}  // namespace oted
