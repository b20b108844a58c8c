#pragma once
/// Logged trajectories: the offline dataset D of the paper (Sec. 3).

#include <cstdint>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/data_options.h"

namespace oted {

/// Rows [begin, end) of a dataset that were logged one after the other.
struct Episode {
  int begin = 0;
  int end = 0;
  bool terminated = false;  ///< ended in a terminal state (no bootstrap); otherwise a time limit or the file's end
  int size() const { return end - begin; }
};

/// N transitions (s, a, s') in the order in which they were logged. Row i: action a_i was taken in state s_i and led to
/// s'_i. Next observations never cross an episode's boundary.
struct Dataset {
  Array2<double> observations;       ///< (N, obs_dim)
  Array2<double> actions;            ///< (N, act_dim)
  Array2<double> next_observations;  ///< (N, obs_dim)
  std::vector<double> rewards;       ///< (N), or empty: the design needs none
  std::vector<uint8_t> terminals;    ///< (N), 1 where s'_i is terminal
  std::vector<uint8_t> timeouts;     ///< (N), 1 where the episode was cut after this row
  Array2<double> qpos;               ///< (N, nq) state before action i, or empty
  Array2<double> qvel;               ///< (N, nv) state before action i, or empty
  /// (N, n): what is known of the recording that row i is of, the values of the task's constants; NaN where they are as
  /// in the model. Empty where the task has none.
  Array2<double> constants;

  double period_s = 0;                         ///< time between two rows [s]; 0 where the file does not say
  std::vector<std::string> observation_names;  ///< one per column, or empty where the file has none
  std::vector<std::string> action_names;       ///< the same for actions
  std::vector<std::string> constant_names;     ///< one per column of `constants`
  /// What the reader left out, inferred or changed by its documented rules, one sentence each.
  std::vector<std::string> remarks;
  /// What it had to change that may make the data worse: the user should look.
  std::vector<std::string> warnings;

  std::string path;    ///< where it was read from; empty when made in memory
  std::string sha256;  ///< of that file; of a Minari dataset, of the hashes of its two, a line each

  int size() const { return observations.rows(); }
  int obs_dim() const { return observations.cols(); }
  int act_dim() const { return actions.cols(); }
  bool has_states() const { return !qpos.empty(); }

  /// Episodes: cut after each terminal and each timeout, and at the end of the file.
  std::vector<Episode> Episodes() const;
  /// (episodes, obs_dim): the first observation of each.
  Array2<double> EpisodeStarts() const;
  /// The undiscounted return of each episode; empty without rewards.
  std::vector<double> EpisodeReturns() const;
  /// The transitions of the given episodes, in that order.
  Dataset Select(const std::vector<Episode>& episodes) const;
  /// Appends all transitions of `other`, which has the same dimensions and optional parts (any, when this one is
  /// empty: it becomes `other`). No episode goes on across the seam. What joins two files has no path and no sha256.
  void Append(const Dataset& other);

  /// @throws DataError naming the first defect: no rows, lengths that disagree, a value that is not finite.
  void Check() const;
  /// @throws DataError when the dimensions are not those of the task.
  void CheckFits(const std::string& task, int obs_dim, int act_dim) const;
};

}  // namespace oted
