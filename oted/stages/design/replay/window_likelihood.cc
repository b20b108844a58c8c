#include "oted/stages/design/replay/window_likelihood.h"

#include <algorithm>
#include <cmath>

namespace oted {

using Eigen::VectorXd;

namespace {
constexpr double kHeaviness = 0.5;         // degrees of freedom of rho, per number of a window
constexpr double kGrowingHeaviness = 4.0;  // the same where errors grow: fast motion is no outlier
constexpr double kBrokenDown = 1e8;        // squared error of a window whose physics broke down
constexpr double kExplainedWithin = 3.0;   // standard deviations of chi-squared

/// `precision` of the readings, those that are not held left out, then that of the unread coordinates' priors.
VectorXd Precision(const ReadingModel& readings, const VectorXd& of_readings, int n_steps) {
  VectorXd precision = readings.Held(n_steps);
  precision.head(of_readings.size()).array() *= of_readings.array();
  precision.tail(readings.n_unread()) = readings.std.cwiseAbs2().cwiseInverse();
  return precision;
}

}  // namespace

WindowLikelihood::WindowLikelihood(const ReadingModel& readings, VectorXd precision, double heaviness)
    : precision_(std::move(precision)), heaviness_(heaviness) {
  const Eigen::Index n_readings = precision_.size() - readings.n_unread();
  const auto n_held = (precision_.head(n_readings).array() > 0).count();
  freedom_ = std::max(1.0, static_cast<double>(n_held) - readings.state_dim());
  for (Eigen::Index i = readings.obs_dim(); i < n_readings; ++i) {
    if (precision_[i] > 0) log_scale_ -= 0.5 * std::log(precision_[i]);
  }
}

WindowLikelihood::WindowLikelihood(const ReadingModel& readings, const VectorXd& variance, int n_steps)
    : WindowLikelihood(readings, Precision(readings, variance.cwiseInverse().replicate(n_steps + 1, 1), n_steps),
                       kHeaviness) {}

WindowLikelihood WindowLikelihood::Growing(const ReadingModel& readings, const VectorXd& sensor, const VectorXd& growth,
                                           int n_steps) {
  VectorXd precision(sensor.size() * (n_steps + 1));
  for (int t = 0; t <= n_steps; ++t) {
    precision.segment(t * sensor.size(), sensor.size()) = VarianceAt(t, n_steps, sensor, growth).cwiseInverse();
  }
  return WindowLikelihood(readings, Precision(readings, precision, n_steps), kGrowingHeaviness);
}

VectorXd WindowLikelihood::VarianceAt(int t, int n_steps, const VectorXd& sensor, const VectorXd& growth) {
  if (sensor.size() == 0) return growth;
  const double share = static_cast<double>(t) / n_steps;
  return sensor + share * share * growth;
}

double WindowLikelihood::SquaredError(const VectorXd& residual) const {
  if (residual.size() == 0) return kBrokenDown;
  return residual.cwiseAbs2().dot(precision_);
}

double WindowLikelihood::LargestExplained() const { return freedom_ + kExplainedWithin * std::sqrt(2 * freedom_); }

bool WindowLikelihood::Explains(const VectorXd& residual) const { return SquaredError(residual) <= LargestExplained(); }

double WindowLikelihood::CostOf(double error) const {
  const double nu = heaviness_ * freedom_;
  return 0.5 * (nu + freedom_) * std::log1p(error / nu);
}

double WindowLikelihood::Cost(const VectorXd& residual) const { return CostOf(SquaredError(residual)); }

double WindowLikelihood::Weight(const VectorXd& residual) const {
  if (residual.size() == 0) return 0;
  return (heaviness_ + 1) / (heaviness_ + SquaredError(residual) / freedom_);
}

}  // namespace oted
