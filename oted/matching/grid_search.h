#pragma once
/// q as probabilities of grid values (grid_distribution.h); its search coordinates x are their indices.

#include <Eigen/Dense>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <vector>

#include "oted/base/rng.h"
#include "oted/matching/grid_distribution.h"
#include "oted/matching/logits.h"
#include "oted/matching/prior.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// One of the two kinds of Designer, which says what the functions of both are.
class GridSearch {
 public:
  /// Uniform over the multiples of `step`. @throws UsageError where the range of a parameter holds too few
  GridSearch(ParameterSpace space, double step);

  const GridDistribution& grid() const { return grid_; }
  void SetProbabilities(int i, std::vector<double> probabilities);

  const Prior& prior() const { return prior_; }
  void SetPrior(const Prior& prior);
  void StartAtPrior(double) { grid_.SetState(grid_.PriorState()); }
  std::vector<double> PriorStd() const;

  SearchSample Draw(Rng& rng) const;
  /// Shared out evenly.
  std::vector<SearchSample> DrawBatch(int n, Rng& rng) const;
  std::vector<double> Mode() const { return grid_.Mode(); }
  std::vector<double> Std() const { return grid_.Std(); }
  std::vector<SearchInterval> CentralInterval(double mass) const;
  double Cumulative(int i, double x) const { return grid_.Cumulative(i, x); }
  double KlToPrior() const { return grid_.KlToPrior(); }
  /// Parameters are independent, and indices have no unit: the identity.
  Eigen::MatrixXd Covariance() const { return Eigen::MatrixXd::Identity(grid_.size(), grid_.size()); }
  Eigen::MatrixXd Correlation() const { return Covariance(); }
  void Ascend(const std::vector<SearchSample>& draws, std::span<const double> advantages, const AscentSteps& steps);

  /// All probabilities.
  std::vector<double> State() const { return grid_.State(); }
  void SetState(const std::vector<double>& state) { grid_.SetState(state); }
  void AddToJson(nlohmann::json& q) const;

 private:
  ParameterSpace space_;
  double step_;
  Prior prior_;
  GridDistribution grid_;
};

}  // namespace oted
