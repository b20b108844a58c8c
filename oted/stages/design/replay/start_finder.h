#pragma once
/// Where replays begin if the logs do not show all of a state.

#include <Eigen/Dense>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/replay.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/replay/windows.h"

namespace oted {

/// Finds the states from which a simulator follows the first readings of stretches best, as predictions of logs that
/// were kept aside begin (PredictionJudge). What it is given must outlive it.
class StartFinder {
 public:
  /// @param factory  whose spec().can_replay()
  /// @param noise    (obs_dim): standard deviation of each channel's noise
  StartFinder(const SimulatorFactory& factory, const Dataset& logs, Eigen::VectorXd noise, int n_threads);

  /// Control steps whose readings a start is fitted to.
  int n_lead() const;
  /// @param rows     where the stretches begin, each within one episode, behind WindowReplayer::n_past_actions() rows
  /// @param n_steps  control steps of a stretch, more than n_lead()
  std::vector<ReplayStart> Find(const std::vector<int>& rows, int n_steps, const std::vector<double>& z);

 private:
  const Dataset& logs_;
  Eigen::VectorXd noise_;
  double period_s_;
  WindowReplayer replayer_;
};

}  // namespace oted
