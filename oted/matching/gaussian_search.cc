#include "oted/matching/gaussian_search.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/bisection.h"
#include "oted/base/error.h"
#include "oted/matching/as_vector.h"

namespace oted {
namespace {

// Narrower than this, q would no longer explore: 0.0005 of the range at its middle.
constexpr double kLogStdMinX = -6.2;
// Wider than this, draws crowd at both bounds.
constexpr double kLogStdMaxX = 0.75;
constexpr double kWideX = 2.0;  // wider than a prior

/// Quantile of the standard normal by bisection on erfc; only for reports.
double NormalQuantile(double p) {
  return Bisect(-10, 10, 80, [&](double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)) < p; });
}

}  // namespace

GaussianSearch::GaussianSearch(ParameterSpace space, double initial_std)
    : space_(std::move(space)),
      prior_(Prior::Uniform(space_.size())),
      mean_(static_cast<size_t>(space_.size()), 0.0),
      log_std_(static_cast<size_t>(space_.size()), std::log(initial_std)),
      correlation_factor_(Eigen::MatrixXd::Identity(space_.size(), space_.size())) {}

GaussianSearch::GaussianSearch(ParameterSpace space, const Eigen::VectorXd& mean, const Eigen::MatrixXd& covariance)
    : GaussianSearch(std::move(space), 1.0) {
  OTED_CHECK(mean.size() == space_.size() && covariance.rows() == space_.size() && covariance.cols() == space_.size());
  mean_.assign(mean.begin(), mean.end());
  const Eigen::VectorXd std = covariance.diagonal().cwiseSqrt();
  for (int i = 0; i < space_.size(); ++i) log_std_[static_cast<size_t>(i)] = std::log(std[i]);
  const Eigen::MatrixXd correlation = std.cwiseInverse().asDiagonal() * covariance * std.cwiseInverse().asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> cholesky(correlation);
  OTED_CHECK(cholesky.info() == Eigen::Success && correlation.allFinite());
  correlation_factor_ = cholesky.matrixL();
}

void GaussianSearch::StartAtPrior(double initial_std) {
  const Eigen::VectorXd std = prior_.Std();
  for (int i = 0; i < size(); ++i) {
    const size_t at = static_cast<size_t>(i);
    mean_[at] = std::clamp(prior_.mean[i], -kLargestLogit, kLargestLogit);
    const double narrower = prior_.uniform ? 0.0 : std::log(std[i] / Prior::kUniformStd);
    log_std_[at] =
        prior_.uniform ? std::log(initial_std) : std::clamp(std::log(initial_std) + narrower, kLogStdMinX, kLogStdMaxX);
  }
  correlation_factor_.setIdentity();
}

Eigen::MatrixXd GaussianSearch::Correlation() const { return correlation_factor_ * correlation_factor_.transpose(); }

Eigen::MatrixXd GaussianSearch::Covariance() const {
  Eigen::VectorXd std(size());
  for (int i = 0; i < size(); ++i) std[i] = std::exp(log_std_[static_cast<size_t>(i)]);
  return std.asDiagonal() * Correlation() * std.asDiagonal();
}

std::vector<SearchSample> GaussianSearch::DrawBatch(int n, Rng& rng) const {
  std::vector<SearchSample> draws;
  for (int k = 0; k < n; ++k) draws.push_back(k % 2 == 0 ? Draw(rng) : Mirror(draws.back()));
  return draws;
}

SearchSample GaussianSearch::Draw(Rng& rng) const {
  Eigen::VectorXd independent(size());
  for (double& noise : independent) noise = rng.Normal();
  SearchSample sample;
  for (int i = 0; i < size(); ++i) {
    const double noise = correlation_factor_.row(i).head(i + 1).dot(independent.head(i + 1));
    const size_t at = static_cast<size_t>(i);
    sample.x.push_back(mean_[at] + std::exp(log_std_[at]) * noise);
  }
  sample.z = LogitToZ(space_, sample.x);
  return sample;
}

SearchSample GaussianSearch::Mirror(const SearchSample& sample) const {
  SearchSample mirrored;
  for (size_t i = 0; i < mean_.size(); ++i) mirrored.x.push_back(2.0 * mean_[i] - sample.x[i]);
  mirrored.z = LogitToZ(space_, mirrored.x);
  return mirrored;
}

std::vector<double> GaussianSearch::Mode() const { return LogitToZ(space_, mean_); }

std::vector<double> GaussianSearch::Std() const {
  std::vector<double> std = log_std_;
  for (double& value : std) value = std::exp(value);
  return StdOf(mean_, std);
}

std::vector<double> GaussianSearch::PriorStd() const {
  const Eigen::VectorXd std = prior_.Std();
  return StdOf({prior_.mean.begin(), prior_.mean.end()}, {std.begin(), std.end()});
}

std::vector<double> GaussianSearch::StdOf(const std::vector<double>& mean, const std::vector<double>& std_of_x) const {
  std::vector<double> std(mean.size());
  for (size_t i = 0; i < mean.size(); ++i) {
    // dz/dx by central difference through the transform and the parameter's own scale. What the logs do not tell at an
    // end of its range is so wide that the derivative there says nothing: then over the 90 % interval.
    const double step = std_of_x[i] > kWideX ? kEndOfInterval * std_of_x[i] : 1e-4;
    std::vector<double> up = mean, down = mean;
    up[i] += step;
    down[i] -= step;
    const double slope = (LogitToZ(space_, up)[i] - LogitToZ(space_, down)[i]) / (2 * step);
    const ParameterSpec& spec = space_[static_cast<int>(i)];
    std[i] = std::min(slope * std_of_x[i], (spec.high - spec.low) / std::sqrt(12.0));
  }
  return std;
}

double GaussianSearch::Cumulative(int i, double x) const {
  std::vector<double> z = Mode();
  const size_t at = static_cast<size_t>(i);
  z[at] = x;
  const double noise = (ZToLogit(space_, z)[at] - mean_[at]) / std::exp(log_std_[at]);
  return 0.5 * std::erfc(-noise / std::sqrt(2.0));
}

std::vector<SearchInterval> GaussianSearch::CentralInterval(double mass) const {
  const double quantile = NormalQuantile(0.5 + 0.5 * mass);
  std::vector<double> low = mean_, high = mean_;
  for (size_t i = 0; i < mean_.size(); ++i) {
    low[i] -= quantile * std::exp(log_std_[i]);
    high[i] += quantile * std::exp(log_std_[i]);
  }
  const std::vector<double> z_low = LogitToZ(space_, low), z_high = LogitToZ(space_, high);
  std::vector<SearchInterval> intervals;
  for (size_t i = 0; i < mean_.size(); ++i) intervals.push_back({z_low[i], z_high[i]});
  return intervals;
}

double GaussianSearch::KlToPrior() const {
  double kl = 0;
  if (!prior_.uniform) {
    const Eigen::MatrixXd covariance = Covariance();
    const Eigen::VectorXd shift = AsVector(mean_) - prior_.mean;
    kl = 0.5 * ((prior_.precision * covariance).trace() + shift.dot(prior_.precision * shift) - size());
    kl += prior_.factor.diagonal().array().log().sum() - correlation_factor_.diagonal().array().log().sum();
    for (const double log_std : log_std_) kl -= log_std;
    return kl;
  }
  for (size_t i = 0; i < mean_.size(); ++i) {
    const double ratio = std::exp(log_std_[i]) / Prior::kUniformStd, shift = mean_[i] / Prior::kUniformStd;
    kl += 0.5 * (ratio * ratio + shift * shift - 1.0) - std::log(ratio);
  }
  // The prior is uncorrelated: correlation adds the logarithm of its determinant alone.
  return kl - correlation_factor_.diagonal().array().log().sum();
}

void GaussianSearch::Ascend(const std::vector<SearchSample>& draws, std::span<const double> advantages,
                            const AscentSteps& steps) {
  OTED_CHECK(draws.size() == advantages.size() && !draws.empty());
  OTED_CHECK(correlation_factor_.isIdentity(0));
  const double n = static_cast<double>(draws.size());
  const Eigen::VectorXd pull = prior_.precision * (AsVector(mean_) - prior_.mean);
  for (size_t i = 0; i < mean_.size(); ++i) {
    const double std = std::exp(log_std_[i]);
    const auto at = static_cast<Eigen::Index>(i);
    const double variance_ratio =
        prior_.uniform ? std * std / (Prior::kUniformStd * Prior::kUniformStd) : std * std * prior_.precision(at, at);
    const double towards_prior = prior_.uniform ? mean_[i] * variance_ratio : std * std * pull[at];
    double score_mean = 0, score_log_std = 0;
    for (size_t k = 0; k < draws.size(); ++k) {
      const double noise = (draws[k].x[i] - mean_[i]) / std;
      score_mean += advantages[k] * noise / n;
      score_log_std += advantages[k] * (noise * noise - 1.0) / n;
    }
    const double natural_mean = std * score_mean - steps.lambda * towards_prior;
    const double natural_log_std = 0.5 * (score_log_std - steps.lambda * (variance_ratio - 1.0));
    // No parameter moves by more than its own spread, nor its spread by more than a third, in one step.
    mean_[i] += std::clamp(steps.mean * natural_mean, -std, std);
    mean_[i] = std::clamp(mean_[i], -kLargestLogit, kLargestLogit);
    log_std_[i] += std::clamp(steps.log_std * natural_log_std, -0.3, 0.3);
    log_std_[i] = std::clamp(log_std_[i], kLogStdMinX, kLogStdMaxX);
  }
}

std::vector<double> GaussianSearch::State() const {
  std::vector<double> state = mean_;
  state.insert(state.end(), log_std_.begin(), log_std_.end());
  return state;
}

void GaussianSearch::SetState(const std::vector<double>& state) {
  OTED_CHECK(state.size() == 2 * mean_.size());
  const auto middle = state.begin() + static_cast<ptrdiff_t>(mean_.size());
  Restore({state.begin(), middle}, {middle, state.end()});
}

void GaussianSearch::Restore(std::vector<double> mean, std::vector<double> log_std) {
  OTED_CHECK(mean.size() == mean_.size() && log_std.size() == mean_.size());
  mean_ = std::move(mean);
  log_std_ = std::move(log_std);
  correlation_factor_.setIdentity();
}

void GaussianSearch::AddToJson(nlohmann::json& q) const {
  q["kind"] = "gaussian";
  q["transform"] = "logistic";
  q["mean"] = mean_;
  const Eigen::MatrixXd covariance = Covariance();
  for (int i = 0; i < size(); ++i) {
    const Eigen::VectorXd row = covariance.row(i);
    q["cov"].push_back(std::vector<double>(row.begin(), row.end()));
  }
  q["prior"] = prior_.ToJson();
}

}  // namespace oted
