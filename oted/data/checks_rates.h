#pragma once
/// Checks of velocities against the positions whose rates they are.

#include "oted/data/checks.h"

namespace oted {

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

/// Seconds per row by positions and velocities: the median, where at least half of them tell it and most of these
/// agree; 0 otherwise.
double PeriodByRates(const std::vector<RateAgreement>& rates);

/// Whether a position that moves so far between two rows jumps by a whole turn. [rad]
bool Wraps(double change);

/// Positions that are kept within one turn.
void CheckWraps(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

/// Positions that go farther in a typical row than any robot does (kImpossibleMotion).
void CheckJumps(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

/// Angles that go so far in a typical row that they are hardly radians.
void CheckTurns(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings);

/// Signs, units, lags, swapped columns, the control rate.
/// @param elsewhere  velocities that another check has explained (checks_turning.h)
void CheckRates(const Dataset& dataset, const TaskFacts& facts, const std::vector<int>& elsewhere,
                std::vector<Finding>& findings);

}  // namespace oted
