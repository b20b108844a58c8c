// q.json, written and read.

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/matching/designer.h"

namespace oted {

nlohmann::json Designer::ToJson(double lambda) const {
  nlohmann::json q;
  q["schema"] = "oted.q/1";
  q["kind"] = grid_ ? "categorical" : "gaussian";
  if (!grid_) q["transform"] = "logistic";
  for (const ParameterSpec& spec : space_.specs()) {
    q["parameters"].push_back(spec.name);
    q["bounds"].push_back({spec.low, spec.high});
    q["scale"].push_back(spec.logarithmic ? "log" : "linear");
  }
  q["lambda"] = lambda;
  q["mode"] = Mode();
  if (grid_) {
    q["grid_step"] = grid_step_;
    for (int i = 0; i < size(); ++i) {
      q["values"].push_back(grid_->values(i));
      q["probabilities"].push_back(grid_->probabilities(i));
    }
    q["prior"] = {{"kind", "uniform"}};
    if (!prior_.uniform) q["prior"] = {{"kind", "categorical"}, {"probabilities", grid_->prior()}};
    return q;
  }
  q["mean"] = mean_;
  const Eigen::MatrixXd covariance = Covariance();
  for (int i = 0; i < size(); ++i) {
    const Eigen::VectorXd row = covariance.row(i);
    q["cov"].push_back(std::vector<double>(row.begin(), row.end()));
  }
  q["prior"] = prior_.ToJson();
  return q;
}

namespace {

void CheckParameter(const nlohmann::json& q, const ParameterSpace& space, size_t i, const std::string& where) {
  const ParameterSpec& spec = space[static_cast<int>(i)];
  const bool same_scale = !q.contains("scale") || q.at("scale").at(i) == (spec.logarithmic ? "log" : "linear");
  if (q.at("parameters").at(i) == spec.name && q.at("bounds").at(i) == nlohmann::json{spec.low, spec.high} &&
      same_scale) {
    return;
  }
  throw DataError(fmt::format("parameter {} of '{}' is not '{}' in [{:g}, {:g}]{}; use the run's own configuration",
                              i + 1, where, spec.name, spec.low, spec.high, spec.logarithmic ? " on a log scale" : ""));
}

}  // namespace

Designer Designer::CategoricalFromJson(const nlohmann::json& q, const ParameterSpace& space, const std::string& where) {
  const double step = q.at("grid_step").get<double>();
  if (!(step > 0))
    throw DataError(fmt::format("'{}' has no positive grid_step; make it again with 'oted design'", where));
  Designer designer = OnGrid(space, step);
  const auto probabilities = q.at("probabilities").get<std::vector<std::vector<double>>>();
  if (probabilities.size() != static_cast<size_t>(space.size())) {
    throw DataError(fmt::format("'{}' has {} parameters, the configuration {}; use the run's own configuration", where,
                                probabilities.size(), space.size()));
  }
  for (size_t i = 0; i < probabilities.size(); ++i) {
    CheckParameter(q, space, i, where);
    const int parameter = static_cast<int>(i);
    if (probabilities[i].size() != designer.grid_->values(parameter).size() ||
        !std::ranges::all_of(probabilities[i], [](double p) { return p > 0 && p <= 1; })) {
      throw DataError(
          fmt::format("'{}' has no probability in (0, 1] for each value of '{}'; make it again with "
                      "'oted design'",
                      where, space[parameter].name));
    }
    designer.grid_->SetProbabilities(parameter, probabilities[i]);
  }
  if (q.contains("prior") && q.at("prior").contains("probabilities")) {
    Prior prior = designer.prior_;
    prior.uniform = false;
    prior.values = q.at("prior").at("probabilities").get<std::vector<std::vector<double>>>();
    bool fits = prior.values.size() == probabilities.size();
    for (size_t i = 0; fits && i < probabilities.size(); ++i) {
      fits = prior.values[i].size() == probabilities[i].size() &&
             std::ranges::all_of(prior.values[i], [](double p) { return p > 0 && p <= 1; });
    }
    if (!fits)
      throw DataError(
          fmt::format("the prior in '{}' does not fit its values; make it again with 'oted design'", where));
    designer.SetPrior(prior);
  }
  return designer;
}

Designer Designer::FromJson(const nlohmann::json& q, const ParameterSpace& space, const std::string& where) {
  try {
    if (q.at("schema") != "oted.q/1" || (q.at("kind") != "gaussian" && q.at("kind") != "categorical")) {
      throw DataError(fmt::format(
          "'{}' is not a Gaussian or categorical q(z) of schema oted.q/1; make it again with 'oted design'", where));
    }
    if (q.at("kind") == "categorical") return CategoricalFromJson(q, space, where);
    const auto mean = q.at("mean").get<std::vector<double>>();
    const auto cov = q.at("cov").get<std::vector<std::vector<double>>>();
    if (mean.size() != static_cast<size_t>(space.size()) || cov.size() != mean.size()) {
      throw DataError(fmt::format("'{}' has {} parameters, the configuration {}; use the run's own configuration",
                                  where, mean.size(), space.size()));
    }
    Eigen::MatrixXd covariance(space.size(), space.size());
    for (size_t i = 0; i < mean.size(); ++i) {
      const ParameterSpec& spec = space[static_cast<int>(i)];
      CheckParameter(q, space, i, where);
      if (cov[i].size() != mean.size() || !(cov[i][i] > 0)) {
        throw DataError(
            fmt::format("'{}' has no positive variance of '{}'; make it again with 'oted design'", where, spec.name));
      }
      for (size_t j = 0; j < mean.size(); ++j) covariance(static_cast<int>(i), static_cast<int>(j)) = cov[i][j];
    }
    if (!covariance.isApprox(covariance.transpose()) ||
        Eigen::LLT<Eigen::MatrixXd>(covariance).info() != Eigen::Success) {
      throw DataError(
          fmt::format("the covariance in '{}' is not positive definite; make it again with 'oted design'", where));
    }
    Designer designer(space, Eigen::Map<const Eigen::VectorXd>(mean.data(), space.size()), covariance);
    if (q.contains("prior")) designer.SetPrior(Prior::FromJson(q.at("prior"), space.size(), where));
    return designer;
  } catch (const nlohmann::json::exception& e) {
    throw DataError(
        fmt::format("'{}' is not a q(z) of schema oted.q/1 ({}); make it again with 'oted design'", where, e.what()));
  }
}

}  // namespace oted
