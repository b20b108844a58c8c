#pragma once
/// One level of trajectory matching: windows of one length, fitted together (trajectory_matching.h has the cost).

#include <Eigen/Dense>
#include <vector>

#include "oted/matching/prior.h"
#include "oted/matching/windows.h"
#include "oted/stages/design/replay_fit.h"
#include "oted/stages/design/stretch_estimate.h"

namespace oted {

/// Windows of one length with their start states, as far as they are known.
struct Level {
  std::vector<LogWindow> windows;
  std::vector<Eigen::VectorXd> starts;
  std::vector<int> stretch;  ///< which stretch of the log each window is part of
};

/// Everything that one level of windows needs to be fitted. What it is given must outlive it.
class LevelFit {
 public:
  /// @param scale  (obs_dim): ChannelScales
  LevelFit(WindowReplayer& replayer, const ParameterSpace& space, const Prior& prior, const Eigen::VectorXd& scale,
           Level level, Eigen::VectorXd x);

  const Eigen::VectorXd& x() const { return x_; }
  const Level& level() const { return level_; }
  const Eigen::VectorXd& noise_variance() const { return variance_; }

  /// One Gauss-Newton step on x and all starts.
  /// @return whether x moved by less than a quarter of its uncertainty
  bool Step();
  /// Negative log likelihood at the present x, starts and noise, after Step; comparable between fits of the same
  /// windows.
  double FinalCost();
  /// The last step, after FinalCost: one undamped Newton step on x with derivatives that are secants over the scale of
  /// the uncertainty, of x and of every start. Under noise the cost is rough at a smaller scale, since contacts begin
  /// and end a physics step earlier or later; tangents tell nothing of that, or everything. From an x that is near, one
  /// such step is as good as the minimum (Le Cam's one-step estimator). On clean logs secants are tangents.
  /// @return the covariance of x
  Eigen::MatrixXd Finish();
  /// Share of windows that count fully, or nearly, after FinalCost.
  double ShareExplained() const;
  /// Windows of twice the length, each from two neighbours; it starts where the first of them does.
  Level Joined() const;

 private:
  /// The quadratic model of one window's cost, weighted.
  struct NormalEquations {
    bool valid = false;
    Eigen::MatrixXd start_start, start_x, x_x;
    Eigen::VectorXd start, x;
  };

  int n_steps() const { return level_.windows.front().n_steps; }
  double SquaredError(const Eigen::VectorXd& residual) const;
  /// rho. A window that broke down counts as a very bad one.
  double WindowCost(const Eigen::VectorXd& residual) const;
  double Cost(const std::vector<Eigen::VectorXd>& residuals, const Eigen::VectorXd& x) const;
  /// Forward differences of these steps: (parameters), and of each window (obs_dim).
  struct Differences {
    Eigen::VectorXd x;
    std::vector<Eigen::VectorXd> starts;
  };
  Differences Tangents() const;
  Differences Secants() const;
  void Linearize(const Differences& steps);
  /// What each stretch says of x at the present linearization.
  std::vector<StretchEvidence> Evidence() const;
  /// The channels' variances, and from them the windows' weights.
  void EstimateNoise();
  std::vector<NormalEquations> Equations() const;

  WindowReplayer& replayer_;
  const ParameterSpace& space_;
  const Prior& prior_;
  const Eigen::VectorXd& scale_;
  Level level_;
  Eigen::VectorXd x_;
  std::vector<double> damping_of_start_;
  double damping_ = 1e-2;
  std::vector<WindowReplayer::Linearization> linear_;
  std::vector<Eigen::VectorXd> residuals_;
  Eigen::VectorXd variance_;     // of each channel's noise
  std::vector<double> weights_;  // of each window
};

}  // namespace oted
