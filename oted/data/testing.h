#pragma once
/// Datasets for tests of this folder. Include from *_test.cc files only.

#include "oted/data/dataset.h"

namespace oted {

/// `n` rows in episodes of `episode` rows, every second of which ends in a terminal. Values are simple expressions of
/// the row, which a test in Python can repeat: observations[i, j] = 0.1 i + j, next_observations the same for i + 1,
/// actions[i, j] = (i mod 8) / 8 - j, rewards[i] = i / 4, qpos[i, j] = 0.3 i - j, qvel[i, j] = i / 3.
inline Dataset MakeTestDataset(int n, int episode, bool with_states = true, bool with_rewards = true) {
  Dataset d;
  d.observations = Array2<double>(n, 3);
  d.next_observations = Array2<double>(n, 3);
  d.actions = Array2<double>(n, 2);
  if (with_states) d.qpos = Array2<double>(n, 2);
  if (with_states) d.qvel = Array2<double>(n, 1);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < 3; ++j) d.observations(i, j) = 0.1 * i + j;
    for (int j = 0; j < 3; ++j) d.next_observations(i, j) = 0.1 * (i + 1) + j;
    for (int j = 0; j < 2; ++j) d.actions(i, j) = (i % 8) / 8.0 - j;
    for (int j = 0; j < d.qpos.cols(); ++j) d.qpos(i, j) = 0.3 * i - j;
    for (int j = 0; j < d.qvel.cols(); ++j) d.qvel(i, j) = i / 3.0;
    if (with_rewards) d.rewards.push_back(i / 4.0);
    const bool last = i % episode == episode - 1;
    const bool terminal = last && (i / episode) % 2 == 1;
    d.terminals.push_back(terminal);
    d.timeouts.push_back(last && !terminal);
  }
  return d;
}

inline bool SameTransitions(const Dataset& a, const Dataset& b) {
  return a.observations == b.observations && a.actions == b.actions && a.next_observations == b.next_observations &&
         a.rewards == b.rewards && a.terminals == b.terminals && a.timeouts == b.timeouts && a.qpos == b.qpos &&
         a.qvel == b.qvel;
}

}  // namespace oted
