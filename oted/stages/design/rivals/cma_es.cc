#include "oted/stages/design/rivals/cma_es.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "oted/base/error.h"

namespace oted {

using Eigen::MatrixXd;
using Eigen::VectorXd;

CmaEs::CmaEs(const VectorXd& start, double sigma, int population)
    : population_(population > 0 ? population : 4 + static_cast<int>(3 * std::log(static_cast<double>(start.size())))),
      mean_(start),
      sigma_(sigma),
      path_sigma_(VectorXd::Zero(start.size())),
      path_covariance_(VectorXd::Zero(start.size())),
      covariance_(MatrixXd::Identity(start.size(), start.size())) {
  OTED_CHECK(start.size() > 0 && sigma > 0 && population_ >= 4);
  weights_.resize(population_ / 2);
  for (int i = 0; i < weights_.size(); ++i) weights_[i] = std::log(0.5 * (population_ + 1)) - std::log(i + 1.0);
  weights_ /= weights_.sum();
  effective_ = 1 / weights_.squaredNorm();
  Decompose();
}

void CmaEs::Decompose() {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(covariance_);
  axes_ = solver.eigenvectors();
  // Rounding may leave an axis without length; it keeps a millionth of a millionth of the longest.
  const double longest = solver.eigenvalues().maxCoeff();
  lengths_ = solver.eigenvalues().cwiseMax(1e-24 * longest).cwiseSqrt();
}

std::vector<VectorXd> CmaEs::Ask(Rng& rng) const {
  std::vector<VectorXd> points;
  for (int k = 0; k < population_; ++k) {
    VectorXd draw(mean_.size());
    for (double& coordinate : draw) coordinate = rng.Normal();
    points.emplace_back(mean_ + sigma_ * (axes_ * lengths_.cwiseProduct(draw)));
  }
  return points;
}

void CmaEs::Tell(const std::vector<VectorXd>& points, std::span<const double> costs) {
  OTED_CHECK(points.size() == static_cast<size_t>(population_) && costs.size() == points.size());
  std::vector<size_t> order(points.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return std::isnan(costs[b]) ? !std::isnan(costs[a]) : costs[a] < costs[b];
  });

  // The learning rates of the tutorial's Table 1.
  const double n = static_cast<double>(mean_.size());
  const double rate_sigma = (effective_ + 2) / (n + effective_ + 5);
  const double damping = 1 + 2 * std::max(0.0, std::sqrt((effective_ - 1) / (n + 1)) - 1) + rate_sigma;
  const double rate_path = (4 + effective_ / n) / (n + 4 + 2 * effective_ / n);
  const double rate_one = 2 / ((n + 1.3) * (n + 1.3) + effective_);
  const double rate_mu =
      std::min(1 - rate_one, 2 * (effective_ - 2 + 1 / effective_) / ((n + 2) * (n + 2) + effective_));
  const double expected_length = std::sqrt(n) * (1 - 1 / (4 * n) + 1 / (21 * n * n));  // of a standard normal vector

  // The mean moves to the weighted better half.
  VectorXd step = VectorXd::Zero(mean_.size());
  MatrixXd spread = MatrixXd::Zero(mean_.size(), mean_.size());
  for (int i = 0; i < weights_.size(); ++i) {
    const VectorXd y = (points[order[static_cast<size_t>(i)]] - mean_) / sigma_;
    step += weights_[i] * y;
    spread += weights_[i] * y * y.transpose();
  }
  mean_ += sigma_ * step;

  // Both evolution paths; the covariance's waits while sigma grows fast.
  ++generation_;
  const VectorXd whitened = axes_ * (axes_.transpose() * step).cwiseQuotient(lengths_);
  path_sigma_ = (1 - rate_sigma) * path_sigma_ + std::sqrt(rate_sigma * (2 - rate_sigma) * effective_) * whitened;
  const double grown = path_sigma_.norm() / std::sqrt(1 - std::pow(1 - rate_sigma, 2 * generation_));
  const bool moves = grown < (1.4 + 2 / (n + 1)) * expected_length;
  path_covariance_ *= 1 - rate_path;
  if (moves) path_covariance_ += std::sqrt(rate_path * (2 - rate_path) * effective_) * step;

  const double lost = moves ? 0 : rate_one * rate_path * (2 - rate_path);
  covariance_ = (1 + lost - rate_one - rate_mu) * covariance_ +
                rate_one * path_covariance_ * path_covariance_.transpose() + rate_mu * spread;
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  sigma_ *= std::exp(std::min(1.0, rate_sigma / damping * (path_sigma_.norm() / expected_length - 1)));
  Decompose();
}

}  // namespace oted
