#pragma once
/// How well a replayed window agrees with the log, under noise of a known variance in every channel.

#include <Eigen/Dense>
#include <utility>

#include "oted/stages/design/replay/reading_model.h"

namespace oted {

/// The negative log density of a scale mixture (Student's t over a whole window), so that windows which nothing
/// explains count less. Residuals are those of WindowReplayer: (n_steps + 1, obs_dim) row by row, then the unread
/// coordinates; empty where the physics broke down.
class WindowLikelihood {
 public:
  /// @param variance  (obs_dim): of each channel's noise
  WindowLikelihood(const ReadingModel& readings, const Eigen::VectorXd& variance, int n_steps);
  /// Where a simulator's errors add up over a window: the standard deviation at step t is what the sensors have and, at
  /// the end of the window, the growth; in between that grows with time.
  /// @param sensor, growth  (obs_dim): variances
  static WindowLikelihood Growing(const ReadingModel& readings, const Eigen::VectorXd& sensor,
                                  const Eigen::VectorXd& growth, int n_steps);

  /// (obs_dim): the variance `t` steps into such a window; `growth`, where there is no `sensor`.
  static Eigen::VectorXd VarianceAt(int t, int n_steps, const Eigen::VectorXd& sensor, const Eigen::VectorXd& growth);

  /// Whether noise alone can have left this residual, its start state fitted: the squared error is within three
  /// standard deviations of what it is then.
  bool Explains(const Eigen::VectorXd& residual) const;
  /// rho. A window that broke down counts as a very bad one.
  double Cost(const Eigen::VectorXd& residual) const;
  /// The logarithm of the noise's scale over the readings that are held behind the start, which Cost leaves out: a fit
  /// with less noise is the likelier one.
  double LogScale() const { return log_scale_; }
  /// rho of the worst window that is explained.
  double CostOfWorstExplained() const { return CostOf(LargestExplained()); }
  /// What the window counts beside one without any error, which counts 3; 0 where it broke down. rho's derivative by
  /// half the squared error, up to a factor.
  double Weight(const Eigen::VectorXd& residual) const;
  /// As residuals: 1 / variance of every number, 0 of those that are not held.
  const Eigen::VectorXd& precision() const { return precision_; }

 private:
  WindowLikelihood(const ReadingModel& readings, Eigen::VectorXd precision, double heaviness);
  /// Of the squared error, over the variances.
  double CostOf(double error) const;
  double LargestExplained() const;
  double SquaredError(const Eigen::VectorXd& residual) const;

  Eigen::VectorXd precision_;
  double freedom_;    // numbers that a window has beyond its start
  double heaviness_;  // degrees of freedom of rho, per number of a window
  double log_scale_ = 0;
};

}  // namespace oted
