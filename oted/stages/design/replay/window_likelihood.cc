#include "oted/stages/design/replay/window_likelihood.h"

#include <cmath>

namespace oted {

using Eigen::VectorXd;

namespace {
constexpr double kHeaviness = 0.5;        // degrees of freedom of rho, per number of a window
constexpr double kBrokenDown = 1e8;       // squared error of a window whose physics broke down
constexpr double kExplainedWithin = 3.0;  // standard deviations of chi-squared
}  // namespace

WindowLikelihood::WindowLikelihood(VectorXd variance, int n_steps)
    : variance_(std::move(variance)),
      precision_(variance_.cwiseInverse().replicate(n_steps + 1, 1)),
      n_steps_(n_steps),
      freedom_(static_cast<double>(variance_.size()) * n_steps) {}

double WindowLikelihood::SquaredError(const VectorXd& residual) const {
  if (residual.size() == 0) return kBrokenDown;
  double error = 0;
  for (int t = 0; t <= n_steps_; ++t) {
    error += (residual.segment(t * variance_.size(), variance_.size()).array().square() / variance_.array()).sum();
  }
  return error;
}

double WindowLikelihood::LargestExplained() const { return freedom_ + kExplainedWithin * std::sqrt(2 * freedom_); }

bool WindowLikelihood::Explains(const VectorXd& residual) const { return SquaredError(residual) <= LargestExplained(); }

double WindowLikelihood::CostOf(double error) const {
  const double nu = kHeaviness * freedom_;
  return 0.5 * (nu + freedom_) * std::log1p(error / nu);
}

double WindowLikelihood::Cost(const VectorXd& residual) const { return CostOf(SquaredError(residual)); }

double WindowLikelihood::Weight(const VectorXd& residual) const {
  if (residual.size() == 0) return 0;
  return (kHeaviness + 1) / (kHeaviness + SquaredError(residual) / freedom_);
}

}  // namespace oted
