#include "oted/matching/designer.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/matching/as_vector.h"

namespace oted {

Designer::Designer(ParameterSpace space, double initial_std)
    : space_(space), kind_(GaussianSearch(space, initial_std)) {}

Designer::Designer(ParameterSpace space, const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance)
    : space_(space), kind_(GaussianSearch(space, mean, covariance)) {}

Designer Designer::OnGrid(ParameterSpace space, double step) { return Designer(space, GridSearch(space, step)); }

const GridDistribution* Designer::grid() const {
  const auto* on_grid = std::get_if<GridSearch>(&kind_);
  return on_grid == nullptr ? nullptr : &on_grid->grid();
}

void Designer::SetPrior(const Prior& prior) {
  OTED_CHECK(prior.size() == size());
  std::visit([&](auto& q) { q.SetPrior(prior); }, kind_);
}

void Designer::Ascend(const std::vector<Sample>& draws, std::span<const double> advantages, const AscentSteps& steps) {
  OTED_CHECK(draws.size() == advantages.size() && !draws.empty());
  std::visit([&](auto& q) { q.Ascend(draws, advantages, steps); }, kind_);
}

void Designer::Restore(std::vector<double> mean, std::vector<double> log_std) {
  std::get<GaussianSearch>(kind_).Restore(std::move(mean), std::move(log_std));
}

void Designer::StartAtPrior(double initial_std) {
  return std::visit([&](auto& q) { return q.StartAtPrior(initial_std); }, kind_);
}

const Prior& Designer::prior() const {
  return std::visit([&](const auto& q) -> const Prior& { return q.prior(); }, kind_);
}

std::vector<double> Designer::PriorStd() const {
  return std::visit([&](const auto& q) { return q.PriorStd(); }, kind_);
}

Designer::Sample Designer::Draw(Rng& rng) const {
  return std::visit([&](const auto& q) { return q.Draw(rng); }, kind_);
}

std::vector<Designer::Sample> Designer::DrawBatch(int n, Rng& rng) const {
  return std::visit([&](const auto& q) { return q.DrawBatch(n, rng); }, kind_);
}

std::vector<double> Designer::Mode() const {
  return std::visit([&](const auto& q) { return q.Mode(); }, kind_);
}

std::vector<double> Designer::Std() const {
  return std::visit([&](const auto& q) { return q.Std(); }, kind_);
}

std::vector<Designer::Interval> Designer::CentralInterval(double mass) const {
  return std::visit([&](const auto& q) { return q.CentralInterval(mass); }, kind_);
}

double Designer::Cumulative(int i, double x) const {
  return std::visit([&](const auto& q) { return q.Cumulative(i, x); }, kind_);
}

double Designer::KlToPrior() const {
  return std::visit([&](const auto& q) { return q.KlToPrior(); }, kind_);
}

Eigen::MatrixXd Designer::Covariance() const {
  return std::visit([&](const auto& q) { return q.Covariance(); }, kind_);
}

Eigen::MatrixXd Designer::Correlation() const {
  return std::visit([&](const auto& q) { return q.Correlation(); }, kind_);
}

std::vector<double> Designer::State() const {
  return std::visit([&](const auto& q) { return q.State(); }, kind_);
}

void Designer::SetState(const std::vector<double>& state) {
  return std::visit([&](auto& q) { return q.SetState(state); }, kind_);
}

nlohmann::json Designer::ToJson(double lambda) const {
  nlohmann::json q;
  q["schema"] = "oted.q/1";
  for (const ParameterSpec& spec : space_.specs()) {
    q["parameters"].push_back(spec.name);
    q["bounds"].push_back({spec.low, spec.high});
    q["scale"].push_back(spec.logarithmic ? "log" : "linear");
  }
  q["lambda"] = lambda;
  q["mode"] = Mode();
  std::visit([&](const auto& own) { own.AddToJson(q); }, kind_);
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

GridSearch GridFromJson(const nlohmann::json& q, const ParameterSpace& space, const std::string& where) {
  const double step = q.at("grid_step").get<double>();
  if (!(step > 0))
    throw DataError(fmt::format("'{}' has no positive grid_step; make it again with 'oted design'", where));
  GridSearch q_of_grid(space, step);
  const auto probabilities = q.at("probabilities").get<std::vector<std::vector<double>>>();
  if (probabilities.size() != static_cast<size_t>(space.size())) {
    throw DataError(fmt::format("'{}' has {} parameters, the configuration {}; use the run's own configuration", where,
                                probabilities.size(), space.size()));
  }
  for (size_t i = 0; i < probabilities.size(); ++i) {
    CheckParameter(q, space, i, where);
    const int parameter = static_cast<int>(i);
    if (probabilities[i].size() != q_of_grid.grid().values(parameter).size() ||
        !std::ranges::all_of(probabilities[i], [](double p) { return p > 0 && p <= 1; })) {
      throw DataError(
          fmt::format("'{}' has no probability in (0, 1] for each value of '{}'; make it again with "
                      "'oted design'",
                      where, space[parameter].name));
    }
    q_of_grid.SetProbabilities(parameter, probabilities[i]);
  }
  if (q.contains("prior") && q.at("prior").contains("probabilities")) {
    Prior prior = q_of_grid.prior();
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
    q_of_grid.SetPrior(prior);
  }
  return q_of_grid;
}

GaussianSearch GaussianFromJson(const nlohmann::json& q, const ParameterSpace& space, const std::string& where) {
  const auto mean = q.at("mean").get<std::vector<double>>();
  const auto cov = q.at("cov").get<std::vector<std::vector<double>>>();
  if (mean.size() != static_cast<size_t>(space.size()) || cov.size() != mean.size()) {
    throw DataError(fmt::format("'{}' has {} parameters, the configuration {}; use the run's own configuration", where,
                                mean.size(), space.size()));
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
  GaussianSearch gaussian(space, AsVector(mean), covariance);
  if (q.contains("prior")) gaussian.SetPrior(Prior::FromJson(q.at("prior"), space.size(), where));
  return gaussian;
}

}  // namespace

Designer Designer::FromJson(const nlohmann::json& q, const ParameterSpace& space, const std::string& where) {
  try {
    if (q.at("schema") != "oted.q/1" || (q.at("kind") != "gaussian" && q.at("kind") != "categorical")) {
      throw DataError(fmt::format(
          "'{}' is not a Gaussian or categorical q(z) of schema oted.q/1; make it again with 'oted design'", where));
    }
    if (q.at("kind") == "categorical") return Designer(space, GridFromJson(q, space, where));
    return Designer(space, GaussianFromJson(q, space, where));
  } catch (const nlohmann::json::exception& e) {
    throw DataError(
        fmt::format("'{}' is not a q(z) of schema oted.q/1 ({}); make it again with 'oted design'", where, e.what()));
  }
}

}  // namespace oted
