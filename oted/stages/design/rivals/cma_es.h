#pragma once
/// CMA-ES, the covariance matrix adaptation evolution strategy: a minimiser for costs without derivatives, of which
/// only the order among the points of one generation matters. After Hansen, The CMA Evolution Strategy: A Tutorial,
/// arXiv:1604.00772, with positive weights alone.

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "oted/base/rng.h"

namespace oted {

/// Usage:
///   CmaEs search(start, 0.5);
///   while (...) {
///     const std::vector<Eigen::VectorXd> points = search.Ask(rng);
///     search.Tell(points, costs of the points);
///   }
///   search.mean();
class CmaEs {
 public:
  /// @param start       (n), where the search begins
  /// @param sigma       how far, in every coordinate, the minimum may be: the first generation's standard deviation
  /// @param population  points per generation, at least 4; 0 takes 4 + floor(3 ln n)
  CmaEs(const Eigen::VectorXd& start, double sigma, int population = 0);

  int population() const { return population_; }
  /// The points of the next generation: draws of N(mean, sigma^2 C).
  std::vector<Eigen::VectorXd> Ask(Rng& rng) const;
  /// Moves mean, sigma and C towards the better half of them. A cost that is no number counts as the worst.
  void Tell(const std::vector<Eigen::VectorXd>& points, std::span<const double> costs);

  /// The best guess: where the distribution is centred.
  const Eigen::VectorXd& mean() const { return mean_; }
  double sigma() const { return sigma_; }
  const Eigen::MatrixXd& covariance() const { return covariance_; }

 private:
  void Decompose();

  int population_;
  Eigen::VectorXd mean_;
  double sigma_;
  Eigen::VectorXd weights_;  // of the better half, best first; they sum to 1
  double effective_ = 0;     // 1 / sum of squared weights
  Eigen::VectorXd path_sigma_, path_covariance_;
  Eigen::MatrixXd covariance_, axes_;  // covariance = axes diag(lengths^2) axes^T
  Eigen::VectorXd lengths_;
  int generation_ = 0;
};

}  // namespace oted
