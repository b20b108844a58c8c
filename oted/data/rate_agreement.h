#pragma once
/// How logged velocities go with the positions whose rates they are.

#include <vector>

#include "oted/data/dataset.h"

namespace oted {

inline constexpr double kClearCorrelation = 0.8;  ///< correlation from which on one number is the rate of another
inline constexpr double kUnitSlack = 0.2;         ///< of a factor
bool Near(double value, double wanted, double slack);

/// How an observed velocity goes with its position.
struct RateAgreement {
  int velocity = 0, position = 0;  ///< observations
  double slope = 0;                ///< change of the position per row, for one of the velocity [s]
  double correlation = 0;          ///< of the two
  double support = 0;              ///< how many rows carry these: the fewer, the more the velocity comes in bursts
  double lag = 0;                  ///< [rows] by which the velocity is late where it goes best with the position
  double lag_gain = 1;             ///< what that leaves of the squared difference
  double offset = 0;               ///< of the velocity, beside the position's change; 0 where that is not sure

  /// Whether the velocity is surely of another row than its position: late, or for a lag below zero too early.
  bool IsShifted() const;
};

/// Of every velocity in the log whose position is there too, where both move. Clipped velocities are left out, and so
/// are jumps of a position by a whole turn.
/// @param period_s  between two rows; 0: unknown, lags are then looked for among few rows
std::vector<RateAgreement> CompareRates(const Dataset& dataset, const std::vector<int>& rate_of, double period_s);

/// The same of one velocity and any position.
RateAgreement CompareRate(const Dataset& dataset, int position, int velocity, double period_s);

/// Seconds per row by positions and velocities: the median, where at least half of them tell it and most of these
/// agree; 0 otherwise.
double PeriodByRates(const std::vector<RateAgreement>& rates);

/// Whether a position that moves so far between two rows jumps by a whole turn. [rad]
bool Wraps(double change);

}  // namespace oted
