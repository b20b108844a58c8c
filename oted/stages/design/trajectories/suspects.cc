#include "oted/stages/design/trajectories/suspects.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/stretch_estimate.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kDirected = 2.0;      // standard deviations
constexpr double kSuspectStep = 0.02;  // of the logarithm of a multiple, of the range of a value
constexpr double kNoticeableLog = 0.1, kNoticeableShare = 0.02;
constexpr double kLargestLog = 2.303;  // a linear model knows nothing of a change tenfold

/// z where the linear model has moved by `change`.
double At(const ParameterSpec& spec, double change) {
  if (spec.scale == ParameterScale::kNominal) return std::exp(std::clamp(change, -kLargestLog, kLargestLog));
  return std::clamp(spec.nominal + change * (spec.high - spec.low), spec.low, spec.high);
}

/// The parts of x and of further parameter `k`.
std::vector<StretchEvidence> WithOne(const std::vector<StretchEvidence>& all, Eigen::Index n_x, Eigen::Index k) {
  std::vector<Eigen::Index> kept(static_cast<size_t>(n_x) + 1, n_x + k);
  for (Eigen::Index i = 0; i < n_x; ++i) kept[static_cast<size_t>(i)] = i;
  std::vector<StretchEvidence> part;
  for (const StretchEvidence& evidence : all) part.push_back({evidence.information(kept, kept), evidence.score(kept)});
  return part;
}

}  // namespace

Prior WithUniform(const Prior& prior) {
  const int n = prior.size();
  if (prior.uniform) return Prior::Uniform(n + 1);
  VectorXd mean = VectorXd::Zero(n + 1);
  MatrixXd covariance = Prior::Uniform(n + 1).Covariance();
  mean.head(n) = prior.mean;
  covariance.topLeftCorner(n, n) = prior.Covariance();
  return Prior::Gaussian(mean, covariance);
}

bool IsNoticeable(const ParameterSpec& spec, double z) {
  if (spec.scale == ParameterScale::kNominal) return std::abs(std::log(z)) > kNoticeableLog;
  return std::abs(z - spec.nominal) > kNoticeableShare * (spec.high - spec.low);
}

SuspectScores ScoreSuspects(const std::vector<ParameterSpec>& specs, const LevelFit& fit, WindowReplayer& wider,
                            const Prior& prior) {
  std::vector<double> nominal, moved;
  for (const ParameterSpec& spec : specs) {
    nominal.push_back(spec.nominal);
    moved.push_back(At(spec, kSuspectStep));
  }
  const auto evidence = fit.EvidenceIn(wider, nominal, moved, kSuspectStep);
  const auto n_x = fit.x().size();
  VectorXd x = VectorXd::Zero(n_x + 1);
  x.head(n_x) = fit.x();
  const Prior with_one = WithUniform(prior);
  SuspectScores scores;
  std::vector<std::pair<double, Suspect>> scored;
  for (size_t k = 0; k < specs.size(); ++k) {
    const auto of_one = WithOne(evidence, n_x, static_cast<Eigen::Index>(k));
    if (std::ranges::all_of(of_one, [&](const StretchEvidence& s) { return s.information(n_x, n_x) == 0; })) continue;
    const StretchEstimate estimate = EstimateFromStretches(of_one, x, with_one);
    const double change = estimate.step[n_x], std = std::sqrt(estimate.covariance(n_x, n_x));
    const double value = At(specs[k], change);
    if (!(std::abs(change) > kDirected * std) || value == nominal[k]) {
      scores.undirected.push_back(specs[k]);
      continue;
    }
    scored.emplace_back(std::abs(change) / std, Suspect{.spec = specs[k], .value = value});
  }
  std::ranges::stable_sort(scored, [](const auto& a, const auto& b) { return a.first > b.first; });
  for (auto& [unused, suspect] : scored) scores.directed.push_back(std::move(suspect));
  return scores;
}

}  // namespace oted
