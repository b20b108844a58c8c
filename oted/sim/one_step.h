#pragma once
/// Logged transitions repeated one by one in the nominal simulator: what differs within a single control step?

#include <map>
#include <optional>
#include <vector>

#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Of each compared row, the simulator was set to s, given a, and its next observation compared with s'.
struct OneStepError {
  int n_rows = 0;                  ///< compared
  int n_unsettable = 0;            ///< rows whose observation determines no state (a clipped velocity)
  int n_diverged = 0;              ///< rows on which the physics broke down
  std::vector<double> rms_error;   ///< per channel, in its unit
  std::vector<double> rms_change;  ///< of the logged s' - s on the same rows: the error of "nothing changes"
  double median_ratio = 0;         ///< median over channels that change of rms_error / rms_change
  /// What is left of the change when row i is given the action of row i + k, for k = -2 .. 2, on the rows that have all
  /// of these neighbours in their episode. What the simulator does under the mean action and what the row's adds to it
  /// get a factor each, so that wrong gains and masses count for no shift. Geometric mean over the channels in which
  /// the action matters; empty where it matters in none, and when there are fewer than 20 rows.
  std::map<int, double> ratio_by_shift;
};

/// Another row's action that explains a row better than its own.
struct ActionShift {
  int shift = 0;              ///< rows later; negative: before
  double error = 0, own = 0;  ///< of ratio_by_shift: with it, and with the row's own action
};

/// What another row's action must leave of the own error to be told of a whole log: clean logs of models whose gains
/// and masses are off reach 0.74.
inline constexpr double kShiftGain = 0.7;

/// The best shift, where it leaves at most `share` of the own error.
std::optional<ActionShift> BetterShift(const OneStepError& error, double share);

/// At most `max_rows` rows, evenly spread over the data. Needs spec().can_set_state and finite data that fit the task.
OneStepError MeasureOneStep(const SimulatorFactory& factory, const Dataset& dataset, int max_rows, int n_threads);

/// The logs' terminals against the task's own rule, applied to s'.
struct TerminalAgreement {
  int n_known = 0;        ///< rows for which the rule gives an answer
  int n_unexplained = 0;  ///< terminal in the log, not by the rule
  int first_unexplained = -1;
  int n_missed = 0;  ///< over by the rule, not terminal in the log
  int first_missed = -1;
};

/// All rows that are terminal in the log, and at most `max_rows` others, evenly spread. Of a disagreement that noise of
/// twice the sensors' can make nothing is known.
/// @param noise_std  per channel, in its unit; 0 where unknown
TerminalAgreement CompareTerminals(const SimulatorFactory& factory, const Dataset& dataset,
                                   const std::vector<double>& noise_std, int max_rows, RngKey key);

}  // namespace oted
