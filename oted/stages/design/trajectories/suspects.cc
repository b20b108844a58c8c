#include "oted/stages/design/trajectories/suspects.h"

#include <algorithm>
#include <cmath>

#include "oted/stages/design/trajectories/stretch_estimate.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSurely = 4.0;            // standard deviations
constexpr double kNoticeableChange = 0.1;  // of log(factor)
constexpr double kLargestLog = 2.303;      // of log(factor): a linear model knows nothing of a change tenfold
constexpr size_t kMost = 3;

/// The parts of x and of further parameter `k`.
std::vector<StretchEvidence> WithOne(const std::vector<StretchEvidence>& all, Eigen::Index n_x, Eigen::Index k) {
  std::vector<Eigen::Index> kept(static_cast<size_t>(n_x) + 1, n_x + k);
  for (Eigen::Index i = 0; i < n_x; ++i) kept[static_cast<size_t>(i)] = i;
  std::vector<StretchEvidence> part;
  for (const StretchEvidence& evidence : all) part.push_back({evidence.information(kept, kept), evidence.score(kept)});
  return part;
}

}  // namespace

std::vector<Suspect> FindSuspects(const SimulatorFactory& factory, const Dataset& dataset, const LevelFit& fit,
                                  const Prior& prior, int n_threads) {
  const std::vector<ParameterSpec> specs = factory.Suspects();
  const std::unique_ptr<SimulatorFactory> wider = specs.empty() ? nullptr : factory.With(specs);
  if (wider == nullptr) return {};
  const int n_lanes = WindowReplayer::LinearizationLanes(wider->parameters().size(), factory.spec().obs_dim());
  WindowReplayer replayer(wider->Make(n_lanes, n_threads), dataset);
  const auto evidence = fit.EvidenceIn(replayer, static_cast<int>(specs.size()));
  const auto n_x = fit.x().size();
  VectorXd x = VectorXd::Zero(n_x + 1), mean = x;
  MatrixXd covariance = Prior::Uniform(static_cast<int>(n_x) + 1).Covariance();
  x.head(n_x) = fit.x();
  mean.head(n_x) = prior.mean;
  covariance.topLeftCorner(n_x, n_x) = prior.Covariance();
  const Prior with_one = Prior::Gaussian(mean, covariance);
  std::vector<Suspect> suspects;
  for (size_t k = 0; k < specs.size(); ++k) {
    const StretchEstimate estimate =
        EstimateFromStretches(WithOne(evidence, n_x, static_cast<Eigen::Index>(k)), x, with_one);
    const double change = estimate.step[n_x], std = std::sqrt(estimate.covariance(n_x, n_x));
    if (!(std::abs(change) > std::max(kNoticeableChange, kSurely * std))) continue;
    suspects.push_back({specs[k].field, std::exp(std::clamp(change, -kLargestLog, kLargestLog)), std});
  }
  const auto certainty = [](const Suspect& s) { return std::abs(std::log(s.factor)) / s.log_std; };
  std::ranges::stable_sort(suspects, [&](const Suspect& a, const Suspect& b) { return certainty(a) > certainty(b); });
  suspects.resize(std::min(suspects.size(), kMost));
  return suspects;
}

}  // namespace oted
