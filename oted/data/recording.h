#pragma once
/// A log as it was recorded: rows with times, before it is cut into transitions.

#include <string>
#include <vector>

#include "oted/data/dataset.h"

namespace oted {

/// Row k holds the observation s_k and the action a_k that was commanded at that moment and held until the next row
/// (zero-order hold).
struct Recording {
  /// Rows [begin, end) of one episode: end - begin - 1 transitions. The last row gives the final observation alone.
  struct Run {
    int begin = 0;
    int end = 0;
    bool terminated = false;  ///< the last transition ends in a terminal state
    double period_s = 0;      ///< mean time between two rows, missing ones counted; 0: the recording's
    bool is_even = true;      ///< rows lie that far apart, and none is missing
    int n_transitions() const { return end - begin - 1; }
  };

  std::string file;
  Array2<double> observations;  ///< (rows, obs_dim)
  Array2<double> actions;       ///< (rows, act_dim); not read in an episode's last row
  std::vector<double> times;    ///< [s], or empty
  std::vector<double> rewards;  ///< of the row's action, or empty
  Array2<double> qpos;          ///< or empty
  Array2<double> qvel;          ///< or empty
  Array2<double> constants;     ///< as a Dataset's
  std::vector<Run> runs;
  /// [s]
  double PeriodOf(const Run& run) const { return run.period_s > 0 ? run.period_s : period_s; }

  double period_s = 0;  ///< mean time between two rows, of the slowest where rates differ; 0 without times
  std::vector<std::string> observation_names;
  std::vector<std::string> action_names;
  std::vector<std::string> constant_names;
  int n_without_action = 0;           ///< rows
  std::vector<std::string> remarks;   ///< as a Dataset's
  std::vector<std::string> warnings;  ///< the same
};

/// Periods that differ by a smaller share are the same.
inline constexpr double kSameRate = 0.01;

/// The recording at one row per `control_period_s` [s]. Even episodes at that rate stay as they are. Of the others,
/// observations, qpos and qvel are interpolated linearly between rows and rewards summed over each period.
///
/// An episode at that rate whose rows are uneven or missing gets rows of its own mean period, each with the action that
/// was in force in the middle of it. A faster one gets the action that was in force at the start of each control
/// period; its grid starts at the row from which the smallest share of the periods sees its action change, and how many
/// do is a warning. What is left over at an episode's end is dropped, and a terminal state with it unless the grid
/// meets it within half a row.
/// @throws DataError when an episode has fewer rows than one per period: what lies between them is not in it.
Recording Resample(const Recording& recording, double control_period_s);

/// The transitions of a recording. @throws DataError when there is none
Dataset ToDataset(const Recording& recording);

}  // namespace oted
