#pragma once
/// Checks of logged trajectories that need no simulator. Statistics and thresholds: docs/data_checks.md.

#include <set>
#include <string>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/data/finding.h"
#include "oted/data/turning_body.h"

namespace oted {

/// What is known of the task that the data were logged from; empty or 0 where it is not known.
struct TaskFacts {
  std::vector<std::string> observation_names = {};
  std::vector<std::string> action_names = {};
  std::vector<double> action_low = {}, action_high = {};  ///< in the actions' own unit
  int max_episode_steps = 0;
  std::vector<int> rate_of = {};         ///< as SimulatorSpec's
  std::vector<TurningBody> bodies = {};  ///< the same
  std::vector<int> positions = {};       ///< observations that have a rate, observed or not
  std::vector<int> radians = {};         ///< those of them that are angles
  double control_period_s = 0;
  bool flat_observations = true;   ///< a vector of quantities; false: an image, whose pixels are not checked one by one
  bool continuous_actions = true;  ///< false: numbers of discrete actions
  bool mujoco_observations = true;  ///< observations may be [qpos without the root's first numbers, qvel]

  /// Observations of the state: positions and velocities.
  std::set<int> States() const;
  /// The task's name of a column, or "observations[3]".
  std::string ObservationName(int j) const;
  std::string ActionName(int j) const;
};

/// The check that logs have to pass before anything is fitted to them.
inline constexpr const char* kImpossibleMotion = "impossible_motion";

/// All checks (checks_*.h), cheap ones: linear in the number of rows but for sorting. Never throws for what the data
/// hold: values that are not finite and arrays that disagree are findings, and then the only ones.
std::vector<Finding> CheckDataset(const Dataset& dataset, const TaskFacts& facts);

}  // namespace oted
