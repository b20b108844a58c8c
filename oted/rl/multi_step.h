#pragma once
/// Transitions over several control steps: rewards travel back faster than one step per update of the critic.

#include <span>
#include <vector>

#include "oted/rl/replay_buffer.h"

namespace oted {

/// Turns the steps of lanes into rows of a replay buffer that reach `n` steps ahead:
///
///   s_t, a_t, s_{t+k}, sum_{i<k} gamma^i r_{t+i}, discount gamma^k
///
/// with k = n, or fewer where the episode ends before. The discount is 0 where the episode terminated: s_{t+k} then has
/// no value.
class MultiStepRows {
 public:
  /// @param n_steps  at least 1, with which a row is a step
  /// @param buffer   outlives this object
  MultiStepRows(int n_lanes, int n_steps, double gamma, ReplayBuffer& buffer);

  /// One step of a lane. Adds the row that it completes, and the shorter ones where it terminates the episode.
  /// @param action  squashed to [-1, 1]
  void Add(int lane, std::span<const double> observation, std::span<const double> action, double reward,
           std::span<const double> next_observation, bool terminated);
  /// The lane's episode is cut, by its time limit or otherwise: its open rows end at its last state, which has a value.
  void Cut(int lane);

 private:
  struct Step {
    std::vector<double> observation, action;
    double reward;
  };
  struct Lane {
    std::vector<Step> open;  ///< the steps whose row is not complete, oldest first
    std::vector<double> next_observation;
  };
  /// The row of the lane's oldest open step, over all open ones.
  void AddOldest(Lane& lane, bool terminated);

  size_t n_steps_;
  double gamma_;
  ReplayBuffer& buffer_;
  std::vector<Lane> lanes_;
};

}  // namespace oted
