#pragma once
/// q(z), the designer of the paper (Sec. 4.1): a distribution over simulator parameters, improved by policy gradient.

#include <Eigen/Dense>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "oted/base/rng.h"
#include "oted/matching/gaussian_search.h"
#include "oted/matching/grid_search.h"
#include "oted/matching/logits.h"
#include "oted/matching/prior.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// Of two kinds: a Gaussian over x, or probabilities of grid values. The prior p is uniform or nearly so
/// (Prior::Uniform), unless another is set.
class Designer {
 public:
  static constexpr double kPriorStd = Prior::kUniformStd;

  Designer() = default;
  /// q starts at the prior, with `initial_std` in x.
  Designer(ParameterSpace space, double initial_std);
  /// The Gaussian of that mean and covariance over x. @throws InternalError unless the covariance is positive definite.
  Designer(ParameterSpace space, const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance);

  /// Uniform over the multiples of `step` within each parameter's bounds. @throws UsageError where there are too few
  static Designer OnGrid(ParameterSpace space, double step);
  /// Null for a Gaussian.
  const GridDistribution* grid() const;

  /// Replaces p; q stays.
  void SetPrior(const Prior& prior);
  /// Puts q at p: a Gaussian at its mean, with `initial_std` where p is uniform and narrower as p is; a grid's
  /// probabilities to p's.
  void StartAtPrior(double initial_std);
  const Prior& prior() const;
  /// Standard deviation of z under p, at most that of the uniform distribution.
  std::vector<double> PriorStd() const;

  const ParameterSpace& space() const { return space_; }
  int size() const { return space_.size(); }

  using Sample = SearchSample;
  Sample Draw(Rng& rng) const;
  /// `n` draws with less noise in their mean: of a Gaussian in mirrored pairs, of a grid shared out evenly.
  std::vector<Sample> DrawBatch(int n, Rng& rng) const;

  /// The paper's mode of q: z at the mean of x, or the most probable grid value.
  std::vector<double> Mode() const;
  /// Standard deviation of z in its own units, to first order in x at the mode, at most that of the uniform prior.
  std::vector<double> Std() const;
  using Interval = SearchInterval;
  /// Central interval of z holding `mass` of q: the image of the Gaussian's.
  std::vector<Interval> CentralInterval(double mass) const;
  /// P(z_i <= x).
  double Cumulative(int i, double x) const;
  /// D_KL(q || p) [nats], summed over parameters.
  double KlToPrior() const;

  /// Covariance over x, and correlation (equal to that of z to first order).
  Eigen::MatrixXd Covariance() const;
  Eigen::MatrixXd Correlation() const;

  /// One ascent step on E_q[R] - lambda KL(q, p) (Eq. 3) from draws and their advantages; each kind says how.
  void Ascend(const std::vector<Sample>& draws, std::span<const double> advantages, const AscentSteps& steps);

  /// What learning changes: mean and log_std of an uncorrelated Gaussian, or all probabilities.
  std::vector<double> State() const;
  void SetState(const std::vector<double>& state);

  /// The draw on the other side of the mean. Of a Gaussian only, as what follows; a grid throws
  /// std::bad_variant_access.
  Sample Mirror(const Sample& sample) const { return gaussian().Mirror(sample); }
  const std::vector<double>& mean() const { return gaussian().mean(); }
  const std::vector<double>& log_std() const { return gaussian().log_std(); }
  /// Sets an uncorrelated q.
  void Restore(std::vector<double> mean, std::vector<double> log_std);

  /// q.json (schema oted.q/1).
  nlohmann::json ToJson(double lambda) const;
  /// @throws DataError when `q` is no such distribution over `space`.
  static Designer FromJson(const nlohmann::json& q, const ParameterSpace& space, const std::string& where);

 private:
  using Kind = std::variant<GaussianSearch, GridSearch>;
  Designer(ParameterSpace space, Kind kind) : space_(std::move(space)), kind_(std::move(kind)) {}
  const GaussianSearch& gaussian() const { return std::get<GaussianSearch>(kind_); }

  ParameterSpace space_;
  Kind kind_;
};

}  // namespace oted
