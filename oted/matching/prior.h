#pragma once
/// The prior p(z) of the paper (Sec. 4.1), over the search coordinates x of q (oted/matching/designer.h).

#include <Eigen/Dense>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/sim/parameter_space.h"

namespace oted {

/// From a normal's mean to an end of its central 90 % [standard deviations].
inline constexpr double kEndOfInterval = 1.645;

/// A Gaussian over x, and, where q is categorical, probabilities of its grid's values.
struct Prior {
  /// Under N(0, 1.7^2) u is close to uniform over the bounds: its standard deviation is 0.29, the uniform one's.
  static constexpr double kUniformStd = 1.7;

  Eigen::VectorXd mean;    ///< (d)
  Eigen::MatrixXd factor;  ///< (d, d): its lower Cholesky factor times a standard normal vector, plus mean, is a draw
  Eigen::MatrixXd precision;  ///< (d, d)
  bool uniform = true;        ///< N(0, kUniformStd^2) of every x, and equal probabilities of grid values
  /// Of a categorical q's values, per parameter; empty: the Gaussian's mass around each value.
  std::vector<std::vector<double>> values;

  static Prior Uniform(int d);
  /// @throws InternalError unless the covariance is positive definite
  static Prior Gaussian(const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance);

  int size() const { return static_cast<int>(mean.size()); }
  Eigen::MatrixXd Covariance() const { return factor * factor.transpose(); }
  Eigen::VectorXd Std() const { return Covariance().diagonal().cwiseSqrt(); }
  /// (x - mean)^T precision (x - mean) / 2: minus the log density, but for a constant.
  double HalfSquare(const Eigen::VectorXd& x) const;
  /// As q.json has it: one mean and std for all x where it is uniform.
  nlohmann::json ToJson() const;
  /// @throws DataError naming `where`
  static Prior FromJson(const nlohmann::json& prior, int d, const std::string& where);
};

}  // namespace oted
