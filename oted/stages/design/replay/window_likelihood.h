#pragma once
/// How well a replayed window agrees with the log, under noise of a known variance in every channel.

#include <Eigen/Dense>
#include <utility>

namespace oted {

/// The negative log density of a scale mixture (Student's t over a whole window), so that windows which nothing
/// explains count less. Residuals are those of WindowReplayer: (n_steps + 1, obs_dim) row by row, empty where the
/// physics broke down.
class WindowLikelihood {
 public:
  /// @param variance  (obs_dim): of each channel's noise
  WindowLikelihood(Eigen::VectorXd variance, int n_steps);

  /// Whether noise alone can have left this residual, its start state fitted: the squared error is within three
  /// standard deviations of what it is then.
  bool Explains(const Eigen::VectorXd& residual) const;
  /// rho. A window that broke down counts as a very bad one.
  double Cost(const Eigen::VectorXd& residual) const;
  /// rho of the worst window that is explained.
  double CostOfWorstExplained() const { return CostOf(LargestExplained()); }
  /// What the window counts beside one without any error, which counts 3; 0 where it broke down. rho's derivative by
  /// half the squared error, up to a factor.
  double Weight(const Eigen::VectorXd& residual) const;
  /// ((n_steps + 1) obs_dim): 1 / variance of every number.
  const Eigen::VectorXd& precision() const { return precision_; }

 private:
  /// Of the squared error, over the variances.
  double CostOf(double error) const;
  double LargestExplained() const;
  double SquaredError(const Eigen::VectorXd& residual) const;

  Eigen::VectorXd variance_, precision_;
  int n_steps_;
  double freedom_;  // numbers that a window has beyond its start
};

}  // namespace oted
