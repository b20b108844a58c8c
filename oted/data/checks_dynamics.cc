#include "oted/data/checks_dynamics.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "oted/base/statistics.h"
#include "oted/data/linear_fit.h"

namespace oted {
namespace {

constexpr int kMostRows = 20000;  // of the fit: whole episodes, evenly taken
constexpr int kFewestRows = 50;
constexpr int kRowsPerCoefficient = 5;
constexpr double kPredictable = 0.5;    // adjusted R^2 from which on noise can be told from motion
constexpr double kVisible = -0.25;      // lag-1 correlation of the residual; white noise alone has -1/2
constexpr double kExactly = 1e-5;       // residual, of the channel's deviation: rounding, not noise
constexpr double kNoisy = 0.1;          // noise of s' - s, of its root mean square: above it a warning
constexpr double kCoarseWarning = 0.7;  // median adjusted R^2 over channels
constexpr double kCoarseNote = 0.9;
constexpr double kClipResiduals = 3;  // robust standard deviations
constexpr double kMadToStd = 1.4826;  // of a Gaussian

/// At most kMostRows rows, whole episodes evenly spread; of a single long one its beginning.
std::vector<Episode> Sample(const Dataset& dataset) {
  std::vector<Episode> episodes = dataset.Episodes();
  const size_t every = static_cast<size_t>((dataset.size() + kMostRows - 1) / kMostRows);
  std::vector<Episode> sample;
  for (size_t e = 0; e < episodes.size(); e += every) {
    Episode episode = episodes[e];
    episode.end = std::min(episode.end, episode.begin + kMostRows);
    sample.push_back(episode);
  }
  return sample;
}

double Variance(const Array2<double>& m, int j) {
  double mean = 0, square = 0;
  for (int i = 0; i < m.rows(); ++i) mean += m(i, j) / m.rows();
  for (int i = 0; i < m.rows(); ++i) square += (m(i, j) - mean) * (m(i, j) - mean) / m.rows();
  return square;
}

}  // namespace

std::vector<ChannelNoise> EstimateNoise(const Dataset& dataset) {
  const int d = dataset.obs_dim(), p = d + dataset.act_dim() + 1;
  const Dataset sample = dataset.Select(Sample(dataset));
  const int n = sample.size();
  if (n < std::max(kFewestRows, kRowsPerCoefficient * p)) return {};

  Array2<double> x(n, p), change(n, d);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < d; ++j) x(i, j) = sample.observations(i, j) - sample.observations(0, j);
    for (int j = 0; j < sample.act_dim(); ++j) x(i, d + j) = sample.actions(i, j);
    x(i, p - 1) = 1;
    for (int j = 0; j < d; ++j) change(i, j) = sample.next_observations(i, j) - sample.observations(i, j);
  }
  const Array2<double> fit = LeastSquares(x, change);

  std::vector<ChannelNoise> noise(static_cast<size_t>(d));
  std::vector<double> r(static_cast<size_t>(n)), magnitude(static_cast<size_t>(n));
  for (int j = 0; j < d; ++j) {
    ChannelNoise& channel = noise[static_cast<size_t>(j)];
    double residual_square = 0, change_square = 0;
    for (int i = 0; i < n; ++i) {
      double predicted = 0;
      for (int k = 0; k < p; ++k) predicted += x(i, k) * fit(k, j);
      r[static_cast<size_t>(i)] = change(i, j) - predicted;
      magnitude[static_cast<size_t>(i)] = std::abs(r[static_cast<size_t>(i)]);
      residual_square += r[static_cast<size_t>(i)] * r[static_cast<size_t>(i)] / (n - p);
      change_square += change(i, j) * change(i, j) / n;
    }
    channel.std = std::sqrt(Variance(sample.observations, j));
    channel.rms_change = std::sqrt(change_square);
    channel.rms_residual = std::sqrt(residual_square);
    const double next_variance = Variance(sample.next_observations, j) * n / (n - 1);
    if (next_variance <= 0) continue;
    channel.r_squared = 1 - residual_square / next_variance;
    if (channel.std <= 0 || channel.r_squared < kPredictable) continue;
    channel.assessable = true;
    const double largest = kClipResiduals * kMadToStd * Median(magnitude);
    for (double& v : r) v = std::clamp(v, -largest, largest);
    double variance = 0, covariance = 0;
    int n_pairs = 0;
    for (int i = 0; i < n; ++i) {
      variance += r[static_cast<size_t>(i)] * r[static_cast<size_t>(i)] / n;
      if (i + 1 == n || sample.terminals[static_cast<size_t>(i)] || sample.timeouts[static_cast<size_t>(i)]) continue;
      covariance += r[static_cast<size_t>(i)] * r[static_cast<size_t>(i) + 1];
      ++n_pairs;
    }
    // White noise makes up all of the residual's variance at most: two times its own.
    channel.below = std::sqrt(variance / 2);
    if (n_pairs < kFewestRows / 2 || std::sqrt(variance) <= kExactly * channel.std) continue;
    covariance /= n_pairs;
    channel.correlation = covariance / variance;
    channel.visible = channel.correlation < kVisible;
    if (channel.visible) channel.sigma = std::sqrt(-covariance);
  }
  return noise;
}

void CheckDynamics(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  if (!facts.flat_observations || !facts.continuous_actions) return;
  const std::vector<ChannelNoise> noise = EstimateNoise(dataset);
  if (noise.empty()) return;

  std::vector<double> predictable;
  for (const ChannelNoise& channel : noise) {
    if (channel.std > 0 && channel.rms_change > 0) predictable.push_back(channel.r_squared);
  }
  const double median = Median(predictable);
  if (!predictable.empty() && median < kCoarseNote) {
    findings.push_back(
        {.check = "low_rate",
         .severity = median < kCoarseWarning ? Severity::kWarning : Severity::kNote,
         .what = fmt::format("a linear map of (s, a) explains {:.0f} % of the variance of s' (median over channels)",
                             100 * std::max(0.0, median)),
         .row = -1,
         .count = static_cast<int64_t>(predictable.size()),
         .meaning = "from one row to the next much happens that the log does not show: too low a rate, actions of "
                    "other rows, or quantities that are not observed; errors of a simulator look alike then",
         .remedy = "log every control step, state and action of the same step; see the one-step error below"});
  }

  std::vector<std::string> strong, weak;
  for (int j = 0; j < static_cast<int>(noise.size()); ++j) {
    const ChannelNoise& channel = noise[static_cast<size_t>(j)];
    if (!channel.visible) continue;
    const double share = std::sqrt(2.0) * channel.sigma / channel.rms_change;
    (share > kNoisy ? strong : weak)
        .push_back(fmt::format("{} (std {:.2g}, {:.0f} % of the change per row)", facts.ObservationName(j),
                               channel.sigma, 100 * share));
  }
  const auto add = [&](Severity severity, const std::vector<std::string>& channels) {
    if (channels.empty()) return;
    findings.push_back({.check = "measurement_noise",
                        .severity = severity,
                        .what = fmt::format("{}", fmt::join(channels, "; ")),
                        .row = -1,
                        .count = static_cast<int64_t>(channels.size()),
                        .channels = channels,
                        .meaning = "the simulator's readings are exact: a discriminator tells the logs by their noise, "
                                   "whatever the parameters are; the default method estimates the noise beside them",
                        .remedy = "none needed for the default method; for the others give the simulator the same "
                                  "noise (obs/NAME/noise_std)",
                        .concern = Concern::kDiscriminatingMethods});
  };
  add(Severity::kWarning, strong);
  add(Severity::kNote, weak);
}

}  // namespace oted
