#pragma once
/// q as a Gaussian over the search coordinates x (logits.h), with diagonal covariance while it is learned by policy
/// gradient.

#include <Eigen/Dense>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "oted/base/rng.h"
#include "oted/matching/logits.h"
#include "oted/matching/prior.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// One of the two kinds of Designer, which says what the functions of both are.
class GaussianSearch {
 public:
  GaussianSearch() = default;
  /// At the uniform prior's mean, with this spread in x.
  GaussianSearch(ParameterSpace space, double initial_std);
  /// @throws InternalError unless the covariance is positive definite
  GaussianSearch(ParameterSpace space, const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance);

  const Prior& prior() const { return prior_; }
  void SetPrior(const Prior& prior) { prior_ = prior; }
  /// At the prior's mean, with `initial_std` where it is uniform, and narrower as it is.
  void StartAtPrior(double initial_std);
  std::vector<double> PriorStd() const;

  SearchSample Draw(Rng& rng) const;
  /// In mirrored pairs.
  std::vector<SearchSample> DrawBatch(int n, Rng& rng) const;
  /// The draw on the other side of the mean.
  SearchSample Mirror(const SearchSample& sample) const;
  std::vector<double> Mode() const;
  std::vector<double> Std() const;
  std::vector<SearchInterval> CentralInterval(double mass) const;
  double Cumulative(int i, double x) const;
  double KlToPrior() const;
  Eigen::MatrixXd Covariance() const;
  Eigen::MatrixXd Correlation() const;

  ///   d/d mean    = mean_k A_k (x_k - mean) / std^2      - lambda P (mean - prior mean)
  ///   d/d log std = mean_k A_k ((x_k - mean)^2/std^2 - 1) - lambda (std^2 P_ii - 1),   P the prior's precision,
  /// both multiplied by the inverse Fisher information (std^2 and 1/2): the natural gradient, so that the step does not
  /// depend on the width of q (docs/deviations.md#natural-gradient). Of an uncorrelated q only.
  void Ascend(const std::vector<SearchSample>& draws, std::span<const double> advantages, const AscentSteps& steps);

  const std::vector<double>& mean() const { return mean_; }
  const std::vector<double>& log_std() const { return log_std_; }
  /// mean and log_std of an uncorrelated Gaussian.
  std::vector<double> State() const;
  void SetState(const std::vector<double>& state);
  void Restore(std::vector<double> mean, std::vector<double> log_std);
  void AddToJson(nlohmann::json& q) const;

 private:
  int size() const { return space_.size(); }
  std::vector<double> StdOf(const std::vector<double>& mean, const std::vector<double>& std) const;

  ParameterSpace space_;
  Prior prior_;
  std::vector<double> mean_, log_std_;
  Eigen::MatrixXd correlation_factor_;  // lower triangular: of x over the standard deviations
};

}  // namespace oted
