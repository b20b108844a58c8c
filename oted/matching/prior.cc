#include "oted/matching/prior.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/matching/as_vector.h"

namespace oted {

using Eigen::LLT;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using nlohmann::json;

Prior Prior::Uniform(int d) {
  const MatrixXd identity = MatrixXd::Identity(d, d);
  return {.mean = VectorXd::Zero(d),
          .factor = kUniformStd * identity,
          .precision = 1.0 / (kUniformStd * kUniformStd) * identity,
          .uniform = true,
          .values = {}};
}

Prior Prior::Gaussian(const VectorXd& mean, const MatrixXd& covariance) {
  const LLT<MatrixXd> cholesky(covariance);
  OTED_CHECK(cholesky.info() == Eigen::Success && covariance.allFinite() && covariance.rows() == mean.size());
  return {.mean = mean,
          .factor = cholesky.matrixL(),
          .precision = cholesky.solve(MatrixXd::Identity(mean.size(), mean.size())),
          .uniform = false,
          .values = {}};
}

double Prior::HalfSquare(const VectorXd& x) const {
  // In this order for the sake of the bytes: most runs have this prior.
  if (uniform) return 0.5 * precision(0, 0) * x.squaredNorm();
  return 0.5 * (x - mean).dot(precision * (x - mean));
}

json Prior::ToJson() const {
  if (uniform) return {{"kind", "gaussian"}, {"mean", 0.0}, {"std", kUniformStd}};
  json prior = {{"kind", "gaussian"}, {"mean", std::vector<double>(mean.begin(), mean.end())}};
  const MatrixXd covariance = Covariance();
  for (int i = 0; i < size(); ++i) {
    const VectorXd row = covariance.row(i);
    prior["cov"].push_back(std::vector<double>(row.begin(), row.end()));
  }
  return prior;
}

Prior Prior::FromJson(const json& prior, int d, const std::string& where) {
  if (!prior.contains("cov")) return Uniform(d);
  const auto mean = prior.at("mean").get<std::vector<double>>();
  const auto rows = prior.at("cov").get<std::vector<std::vector<double>>>();
  MatrixXd covariance = MatrixXd::Zero(d, d);
  bool fits = static_cast<int>(mean.size()) == d && static_cast<int>(rows.size()) == d;
  for (int i = 0; fits && i < d; ++i) {
    const std::vector<double>& row = rows[static_cast<size_t>(i)];
    fits = static_cast<int>(row.size()) == d;
    if (fits) covariance.row(i) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), d);
  }
  if (!fits || !covariance.isApprox(covariance.transpose()) || LLT<MatrixXd>(covariance).info() != Eigen::Success) {
    throw DataError(
        fmt::format("the prior in '{}' is no Gaussian over {} parameters; make it again with 'oted design'", where, d));
  }
  return Gaussian(AsVector(mean), covariance);
}

}  // namespace oted
