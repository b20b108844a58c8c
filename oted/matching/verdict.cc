#include "oted/matching/verdict.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "oted/base/bisection.h"
#include "oted/base/error.h"

namespace oted {
namespace {

constexpr double kIdentifiedBelow = 0.25;  // of the prior's standard deviation
constexpr double kWeakBelow = 0.6;
constexpr double kNoGapMargin = 0.1;     // nats of the common score
constexpr double kNoGainMargin = 0.005;  // nats that a design must win over the nominal simulator
constexpr double kMatchMargin = 0.35;
constexpr double kDriftAbove = 1.4;      // times the noise of short windows, of one channel
constexpr double kDriftTogether = 1.15;  // the same, of all channels together
constexpr double kFewExplained = 0.6;    // of the windows: with fewer,
constexpr double kPatience = 1.25;       // times those factors
constexpr double kVisible = 1e-4;        // of a channel's spread: below is rounding, which contact magnifies
constexpr double kNoticeable = 0.04;     // in x: a hundredth of the range at its middle
constexpr double kMovedAbove = 0.05;     // of the range
constexpr double kAtBound = 0.01;        // of the range

/// z at which the mixture of distributions on a grid has the given cumulative probability for parameter i.
double GridMixtureQuantile(const std::vector<Designer>& designs, size_t i, double probability) {
  const ParameterSpec& spec = designs[0].space()[static_cast<int>(i)];
  return Bisect(spec.low, spec.high, 60, [&](double z) {
    double mass = 0;
    for (const Designer& q : designs) {
      mass += q.Cumulative(static_cast<int>(i), z) / static_cast<double>(designs.size());
    }
    return mass < probability;
  });
}

/// x at which the mixture of Gaussians of parameter i has the given cumulative probability; by bisection.
double MixtureQuantile(const std::vector<Designer>& designs, size_t i, double probability) {
  return Bisect(-20, 20, 60, [&](double x) {
    double mass = 0;
    for (const Designer& q : designs) {
      const double noise = (x - q.mean()[i]) / std::exp(q.log_std()[i]);
      mass += 0.5 * std::erfc(-noise / std::numbers::sqrt2) / static_cast<double>(designs.size());
    }
    return mass < probability;
  });
}

double ZOf(const Designer& q, size_t i, double x) {
  std::vector<double> all(static_cast<size_t>(q.size()), 0.0);
  all[i] = x;
  return LogitToZ(q.space(), all)[i];
}

}  // namespace

std::string ToString(ParameterVerdict verdict) {
  switch (verdict) {
    case ParameterVerdict::kIdentified:
      return "identified";
    case ParameterVerdict::kWeak:
      return "weak";
    case ParameterVerdict::kNotIdentified:
      return "not_identified";
  }
  throw InternalError("unknown parameter verdict");
}

std::string ToString(DesignVerdict verdict) {
  switch (verdict) {
    case DesignVerdict::kNoGap:
      return "no_gap";
    case DesignVerdict::kGapClosed:
      return "gap_closed";
    case DesignVerdict::kOutsideFamily:
      return "outside_family";
  }
  throw InternalError("unknown design verdict");
}

std::vector<ParameterSummary> SummarizeParameters(const std::vector<Designer>& designs, int best,
                                                  const std::vector<bool>& has_effect) {
  OTED_CHECK(!designs.empty());
  const ParameterSpace& space = designs[0].space();
  const double n = static_cast<double>(designs.size());
  std::vector<ParameterSummary> summaries;
  for (int p = 0; p < space.size(); ++p) {
    const size_t i = static_cast<size_t>(p);
    ParameterSummary summary;
    double mean = 0, within = 0, between = 0;
    for (const Designer& q : designs) mean += q.Mode()[i] / n;
    for (const Designer& q : designs) {
      within += q.Std()[i] * q.Std()[i] / n;
      between += (q.Mode()[i] - mean) * (q.Mode()[i] - mean) / n;
    }
    summary.mode = designs[static_cast<size_t>(best)].Mode()[i];
    summary.std = std::sqrt(within + between);
    if (designs[0].grid() != nullptr) {
      summary.interval90_low = GridMixtureQuantile(designs, i, 0.05);
      summary.interval90_high = GridMixtureQuantile(designs, i, 0.95);
    } else {
      summary.interval90_low = ZOf(designs[0], i, MixtureQuantile(designs, i, 0.05));
      summary.interval90_high = ZOf(designs[0], i, MixtureQuantile(designs, i, 0.95));
    }
    // What the prior knew already the logs did not tell.
    const double uniform_std = (space[p].high - space[p].low) / std::sqrt(12.0);
    const double prior_std = designs[0].prior().uniform ? uniform_std : designs[0].PriorStd()[i];
    if (!has_effect[i] || summary.std >= kWeakBelow * prior_std) {
      summary.verdict = ParameterVerdict::kNotIdentified;
    } else {
      summary.verdict =
          summary.std < kIdentifiedBelow * prior_std ? ParameterVerdict::kIdentified : ParameterVerdict::kWeak;
    }
    summaries.push_back(summary);
  }
  return summaries;
}

DesignVerdict JudgeDesign(double nominal_common, double designed_common) {
  const double nominal_gap = std::numbers::ln2 - nominal_common, designed_gap = std::numbers::ln2 - designed_common;
  if (nominal_gap < kNoGapMargin && nominal_gap - designed_gap < kNoGainMargin) return DesignVerdict::kNoGap;
  if (designed_gap < kMatchMargin || designed_gap < 0.5 * nominal_gap) return DesignVerdict::kGapClosed;
  return DesignVerdict::kOutsideFamily;
}

std::vector<int> DisagreeingChannels(const FitEvidence& fit) {
  const bool few = fit.explained < kFewExplained;
  const std::vector<double>& noise_std = few ? fit.noise_std : fit.long_noise_std;
  const double patience = few ? kPatience : 1.0;
  double growth = 0, n_visible = 0;
  const auto is_visible = [&](size_t c) { return noise_std[c] > kVisible * fit.scale[c]; };
  for (size_t c = 0; c < noise_std.size(); ++c) {
    if (!is_visible(c)) continue;
    growth += std::log(noise_std[c] / fit.short_noise_std[c]);
    ++n_visible;
  }
  const bool together = growth > n_visible * std::log(patience * kDriftTogether);
  const double above = patience * (together ? kDriftTogether : kDriftAbove);
  std::vector<int> channels;
  for (size_t c = 0; c < noise_std.size(); ++c) {
    if (is_visible(c) && noise_std[c] > above * fit.short_noise_std[c]) channels.push_back(static_cast<int>(c));
  }
  return channels;
}

std::vector<int> ParametersAtBounds(const Designer& q) {
  const std::vector<double> mode = q.space().ToUnit(q.Mode()), nominal = q.space().ToUnit(q.space().Nominal());
  std::vector<int> at_bounds;
  for (size_t i = 0; i < mode.size(); ++i) {
    const bool low = mode[i] < kAtBound && nominal[i] > 2 * kAtBound;
    const bool high = mode[i] > 1 - kAtBound && nominal[i] < 1 - 2 * kAtBound;
    if (low || high) at_bounds.push_back(static_cast<int>(i));
  }
  return at_bounds;
}

DesignVerdict JudgeFit(const Designer& q, const FitEvidence& fit) {
  if (!fit.suspects.empty() || !DisagreeingChannels(fit).empty() || !ParametersAtBounds(q).empty()) {
    return DesignVerdict::kOutsideFamily;
  }
  const std::vector<double> nominal = ZToLogit(q.space(), q.space().Nominal());
  Eigen::MatrixXd covariance = q.Covariance();
  Eigen::VectorXd difference(q.size());
  for (int i = 0; i < q.size(); ++i) {
    difference[i] = nominal[static_cast<size_t>(i)] - q.mean()[static_cast<size_t>(i)];
    covariance(i, i) += kNoticeable * kNoticeable;
  }
  const double distance = difference.dot(covariance.ldlt().solve(difference));
  // The 99 % quantile of chi-squared, by Wilson and Hilferty (1931).
  const double n = q.size(), third = 2.0 / (9.0 * n);
  const double quantile = n * std::pow(1.0 - third + 2.3263 * std::sqrt(third), 3);
  return distance <= quantile ? DesignVerdict::kNoGap : DesignVerdict::kGapClosed;
}

bool HasMoved(const ParameterSpace& space, const std::vector<ParameterSummary>& summaries) {
  for (int i = 0; i < space.size(); ++i) {
    const ParameterSummary& s = summaries[static_cast<size_t>(i)];
    const double distance = std::abs(s.mode - space[i].nominal);
    if (s.verdict == ParameterVerdict::kIdentified && distance > 3 * s.std &&
        distance > kMovedAbove * (space[i].high - space[i].low)) {
      return true;
    }
  }
  return false;
}

}  // namespace oted
