#pragma once
/// Windows of tenths of a second to a second, for logs that the simulators of the family do not explain down to the
/// sensors' noise: recordings of real robots. There short windows tell of little but noise and of how velocities were
/// differentiated, and what matters is prediction.

#include <Eigen/Dense>
#include <functional>
#include <vector>

#include "oted/base/log.h"
#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/matching/prior.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

/// Windows of `n_steps` in all of the logs, at most some `n_rows` rows of them, spread evenly. Windows that begin
/// within the same second of an episode are one stretch: what a simulator has wrong there is wrong in all of them.
Level LongWindows(WindowReplayer& replayer, const Dataset& dataset, int n_steps, int n_rows, double period_s);

/// How well simulators predict logged episodes, open loop: each window's start is fitted to its first readings, as the
/// simulator at z sees them, and the rest is predicted.
class PredictionJudge {
 public:
  /// @param logs      must outlive this object
  /// @param noise     (obs_dim): standard deviation of each channel's noise, what short windows leave
  /// @param n_lead    readings to which starts are fitted [control steps]
  /// @param n_steps   predicted control steps
  PredictionJudge(WindowReplayer& replayer, const Dataset& logs, const Eigen::VectorXd& noise, int n_lead, int n_steps);

  int n_windows() const { return static_cast<int>(windows_.size()); }
  /// (channels, windows): mean squared errors, the noise's variance added; at most the channel's variance over the
  /// logs.
  Eigen::MatrixXd MeanSquares(const std::vector<double>& z);
  /// The same z's root mean square error over windows and the first `n_steps` predicted steps, per channel.
  Eigen::VectorXd Rms(const std::vector<double>& z, int n_steps);

 private:
  std::vector<Eigen::VectorXd> Predict(const std::vector<double>& z);

  WindowReplayer& replayer_;
  Eigen::VectorXd variance_, spread_, start_step_;
  int n_lead_, n_steps_;
  std::vector<LogWindow> windows_;
};

/// A fit of long windows, chosen among lengths by prediction of episodes that it did not see.
struct LongFitChoice {
  int n_steps = 0;    ///< of the windows; 0: no length predicts better than the short windows' parameters
  Eigen::VectorXd x;  ///< fitted to part of the logs
};

struct LongFitInputs {
  const SimulatorFactory& factory;
  const Dataset& dataset;
  const Prior& prior;
  Eigen::VectorXd short_x;  ///< what short windows gave
  Eigen::VectorXd noise;    ///< (obs_dim): standard deviations, what short windows left
  int short_steps = 0;      ///< length of the short windows
};

/// Fits windows of 0.05 s to 1 s to four fifths of the logs, from the nominal parameters and from those of the short
/// windows, and compares how they predict the rest over half a second (less where episodes are shorter).
/// @param tell  called with x after every step
LongFitChoice ChooseLongWindows(const LongFitInputs& inputs, RngKey key, const RunContext& context,
                                const std::function<void(const Eigen::VectorXd&)>& tell);

}  // namespace oted
