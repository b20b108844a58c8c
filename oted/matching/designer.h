#pragma once
/// q(z), the designer of the paper (Sec. 4.1): a distribution over simulator parameters, improved by policy gradient.

#include <Eigen/Dense>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "oted/base/rng.h"
#include "oted/matching/grid_distribution.h"
#include "oted/matching/prior.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// The search coordinates of q: x in R^d; u = 1 / (1 + exp(-x)) lies in the unit cube, ParameterSpace maps it into the
/// bounds. Beyond |x| = 6 (0.25 % of the range) ZToLogit stops: a value on its bound has no finite logit.
double LogitToUnit(double x);
std::vector<double> LogitToZ(const ParameterSpace& space, std::span<const double> x);
std::vector<double> ZToLogit(const ParameterSpace& space, std::span<const double> z);

/// Of two kinds. A categorical one holds probabilities of grid values (grid_distribution.h); its x are their indices.
/// Otherwise it is a Gaussian over x, with diagonal covariance while it is learned by policy gradient. The prior p is
/// uniform or nearly so (Prior::Uniform), unless another is set.
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
  const GridDistribution* grid() const { return grid_ ? &*grid_ : nullptr; }

  /// Replaces p; q stays.
  void SetPrior(const Prior& prior);
  /// Puts q at p: a Gaussian at its mean, with `initial_std` where p is uniform and narrower as p is; a grid's
  /// probabilities to p's.
  void StartAtPrior(double initial_std);
  const Prior& prior() const { return prior_; }
  /// Standard deviation of z under p, at most that of the uniform distribution.
  std::vector<double> PriorStd() const;

  const ParameterSpace& space() const { return space_; }
  int size() const { return space_.size(); }

  /// One draw: x, and z = z(x).
  struct Sample {
    std::vector<double> x;
    std::vector<double> z;
  };
  Sample Draw(Rng& rng) const;
  /// `n` draws with less noise in their mean: of a Gaussian in mirrored pairs, of a grid shared out evenly.
  std::vector<Sample> DrawBatch(int n, Rng& rng) const;
  /// The draw on the other side of the mean; of a Gaussian only, as all that speaks of x, mean and log_std.
  Sample Mirror(const Sample& sample) const;

  /// The paper's mode of q: z at the mean of x, or the most probable grid value.
  std::vector<double> Mode() const;
  /// Standard deviation of z in its own units, to first order in x at the mode, at most that of the uniform prior.
  std::vector<double> Std() const;
  /// Central interval of z holding `mass` of q: the image of the Gaussian's.
  struct Interval {
    double low, high;
  };
  std::vector<Interval> CentralInterval(double mass) const;
  /// P(z_i <= x).
  double Cumulative(int i, double x) const;
  /// D_KL(q || p) [nats], summed over parameters.
  double KlToPrior() const;

  /// Covariance over x, and correlation (equal to that of z to first order).
  Eigen::MatrixXd Covariance() const;
  Eigen::MatrixXd Correlation() const;

  /// One ascent step on E_q[R] - lambda KL(q, p) (Eq. 3) from draws and their advantages.
  ///   d/d mean    = mean_k A_k (x_k - mean) / std^2      - lambda P (mean - prior mean)
  ///   d/d log std = mean_k A_k ((x_k - mean)^2/std^2 - 1) - lambda (std^2 P_ii - 1),   P the prior's precision,
  /// both multiplied by the inverse Fisher information (std^2 and 1/2): the natural gradient, so that the step does not
  /// depend on the width of q (docs/deviations.md#natural-gradient). Of an uncorrelated q only.
  void Ascend(const std::vector<Sample>& draws, std::span<const double> advantages, double lambda, double step_mean,
              double step_log_std);

  const std::vector<double>& mean() const { return mean_; }
  const std::vector<double>& log_std() const { return log_std_; }
  /// What learning changes: mean and log_std of an uncorrelated Gaussian, or all probabilities.
  std::vector<double> State() const;
  void SetState(const std::vector<double>& state);
  /// Sets an uncorrelated q.
  void Restore(std::vector<double> mean, std::vector<double> log_std);

  /// q.json (schema oted.q/1).
  nlohmann::json ToJson(double lambda) const;
  /// @throws DataError when `q` is no such distribution over `space`.
  static Designer FromJson(const nlohmann::json& q, const ParameterSpace& space, const std::string& where);

 private:
  static Designer CategoricalFromJson(const nlohmann::json& q, const ParameterSpace& space, const std::string& where);
  ParameterSpace space_;
  std::vector<double> StdOf(const std::vector<double>& mean, const std::vector<double>& std) const;

  Prior prior_;
  std::vector<double> mean_, log_std_;
  std::optional<GridDistribution> grid_;
  double grid_step_ = 0;
  Eigen::MatrixXd correlation_factor_;  // lower triangular: of x over the standard deviations
};

}  // namespace oted
