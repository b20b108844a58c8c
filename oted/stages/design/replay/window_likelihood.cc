#include "oted/stages/design/replay/window_likelihood.h"

#include <cmath>

namespace oted {

using Eigen::VectorXd;

namespace {
constexpr double kHeaviness = 0.5;         // degrees of freedom of rho, per number of a window
constexpr double kGrowingHeaviness = 4.0;  // the same where errors grow: fast motion is no outlier
constexpr double kBrokenDown = 1e8;        // squared error of a window whose physics broke down
constexpr double kExplainedWithin = 3.0;   // standard deviations of chi-squared
}  // namespace

WindowLikelihood::WindowLikelihood(int n_channels, int n_steps, VectorXd precision, double heaviness)
    : precision_(std::move(precision)), freedom_(static_cast<double>(n_channels) * n_steps), heaviness_(heaviness) {}

WindowLikelihood::WindowLikelihood(const VectorXd& variance, int n_steps)
    : WindowLikelihood(static_cast<int>(variance.size()), n_steps, variance.cwiseInverse().replicate(n_steps + 1, 1),
                       kHeaviness) {}

WindowLikelihood WindowLikelihood::Growing(const VectorXd& sensor, const VectorXd& growth, int n_steps) {
  VectorXd precision(sensor.size() * (n_steps + 1));
  for (int t = 0; t <= n_steps; ++t) {
    const double share = static_cast<double>(t) / n_steps;
    precision.segment(t * sensor.size(), sensor.size()) = (sensor + share * share * growth).cwiseInverse();
  }
  return WindowLikelihood(static_cast<int>(sensor.size()), n_steps, std::move(precision), kGrowingHeaviness);
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
