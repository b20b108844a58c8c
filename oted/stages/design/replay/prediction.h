#pragma once
/// Open-loop prediction of logged episodes: what a designed simulator is for.

#include <Eigen/Dense>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/matching/fit_evidence.h"
#include "oted/stages/design/replay/windows.h"

namespace oted {

/// How well simulators predict logged episodes, open loop: each window's start is fitted to its first readings, as the
/// simulator at z sees them, and the rest is predicted.
class PredictionJudge {
 public:
  /// @param logs      must outlive this object
  /// @param noise     (obs_dim): standard deviation of each channel's noise, what short windows leave
  /// @param n_steps   predicted control steps; fewer where no episode is long enough
  /// @param period_s  control period [s]: starts are fitted to the readings of 0.05 s, at least four steps
  PredictionJudge(WindowReplayer& replayer, const Dataset& logs, const Eigen::VectorXd& noise, int n_steps,
                  double period_s);

  /// Windows that overlap by half; 0 where no episode is long enough.
  int n_windows() const { return static_cast<int>(windows_.size()); }
  int n_steps() const { return n_steps_; }
  /// (channels, windows): mean squared errors, the noise's variance added; at most the channel's variance over the
  /// logs.
  Eigen::MatrixXd MeanSquares(const std::vector<double>& z);
  /// Per entry of `marks` [predicted steps, at most n_steps()]: the root mean square error of each channel over windows
  /// and the steps up to there. NaN where the physics broke down in every window.
  std::vector<Eigen::VectorXd> Rms(const std::vector<double>& z, const std::vector<int>& marks);

 private:
  std::vector<Eigen::VectorXd> Predict(const std::vector<double>& z);

  WindowReplayer& replayer_;
  Eigen::VectorXd variance_, spread_, start_step_;
  int n_lead_, n_steps_;
  std::vector<LogWindow> windows_;
};

/// The error of the nominal simulator and of a designed one over 0.1, 0.5 and 1 s, as far as the episodes last that
/// long; none where no window can be predicted.
/// @param designed  z that was found without `judge`'s logs
HeldOutPrediction PredictHeldOut(PredictionJudge& judge, const std::vector<double>& nominal,
                                 const std::vector<double>& designed, double period_s);

}  // namespace oted
