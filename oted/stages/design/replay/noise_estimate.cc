#include "oted/stages/design/replay/noise_estimate.h"

#include <algorithm>
#include <utility>

#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/replay/start_fit.h"
#include "oted/stages/design/replay/window_likelihood.h"
#include "oted/stages/design/replay/windows.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kMedianOfSquaredNormal = 0.4549;
constexpr double kLeastFreedom = 1e-3;  // below it a residual is that of the fit and not of the reading
constexpr int kLeverageRounds = 3;
constexpr int kNoiseWindows = 240, kNoiseRounds = 3, kNoiseStartIterations = 3;
constexpr double kHardlyCorrelated = 0.05;  // of a variance: where a correlation time ends

/// 1 - h_i of every number of a window. @param precision  of every number
VectorXd Freedom(const FittedWindow& window, const VectorXd& precision) {
  if (window.d_start.cols() == 0) return VectorXd::Ones(window.residual.size());
  const MatrixXd whitened = precision.cwiseSqrt().asDiagonal() * window.d_start;
  const MatrixXd normal = whitened.transpose() * whitened;
  const MatrixXd solved = normal.ldlt().solve(whitened.transpose());
  return (1 - whitened.transpose().cwiseProduct(solved).colwise().sum().transpose().array()).max(0.0);
}

/// Of one channel. @param errors  (n) of each window
double CorrelationTime(const std::vector<VectorXd>& errors) {
  double square = 0;
  for (const VectorXd& error : errors) square += error.squaredNorm();
  const Eigen::Index n = errors.empty() || square == 0 ? 0 : errors.front().size();
  double time = 1;
  for (Eigen::Index lag = 1; lag < n; ++lag) {
    double product = 0;
    for (const VectorXd& error : errors) product += error.head(n - lag).dot(error.tail(n - lag));
    if (product < kHardlyCorrelated * square) break;
    time += 2 * product / square;  // of n - lag pairs in n: no more than n where all err alike
  }
  return time;
}

/// The value at which half of the weight lies below. `values` is (value, weight), not empty.
double WeightedMedian(std::vector<std::pair<double, double>>& values) {
  std::sort(values.begin(), values.end());
  double total = 0, below = 0;
  for (const auto& [value, weight] : values) total += weight;
  for (const auto& [value, weight] : values) {
    below += weight;
    if (below >= 0.5 * total) return value;
  }
  return values.back().first;
}

}  // namespace

VectorXd NoiseVariance(const ReadingModel& readings, const std::vector<FittedWindow>& windows, const VectorXd& guess,
                       const VectorXd& smallest) {
  const Eigen::Index n_channels = guess.size();
  const VectorXd floor = smallest.cwiseMax(readings.smallest_std.cwiseAbs2());
  VectorXd variance = guess.cwiseMax(floor);
  for (int round = 0; round < kLeverageRounds; ++round) {
    std::vector<std::vector<std::pair<double, double>>> of_channel(static_cast<size_t>(n_channels));
    VectorXd precision;
    for (const FittedWindow& window : windows) {
      if (window.residual.size() == 0) continue;
      const Eigen::Index n_readings = window.residual.size() - readings.n_unread();
      if (precision.size() == 0) {
        const auto n_steps = static_cast<int>(n_readings / n_channels) - 1;
        precision = WindowLikelihood(readings, variance, n_steps).precision();
      }
      const VectorXd freedom = Freedom(window, precision);
      for (Eigen::Index i = 0; i < n_readings; ++i) {
        const Eigen::Index c = i % n_channels;
        const double square = window.residual[i] * window.residual[i];
        if (i / n_channels < readings.ages[static_cast<size_t>(c)]) continue;
        if (freedom[i] < kLeastFreedom || square <= smallest[c]) continue;
        of_channel[static_cast<size_t>(c)].emplace_back(square / freedom[i], freedom[i]);
      }
    }
    for (Eigen::Index c = 0; c < n_channels; ++c) {
      auto& squares = of_channel[static_cast<size_t>(c)];
      variance[c] = squares.empty() ? floor[c] : std::max(floor[c], WeightedMedian(squares) / kMedianOfSquaredNormal);
    }
  }
  return variance;
}

double CorrelationTime(const std::vector<FittedWindow>& windows, const VectorXd& weight, Eigen::Index n_channels) {
  const VectorXd root = weight.cwiseSqrt();
  double sum = 0;
  int n_held = 0;
  for (Eigen::Index c = 0; c < n_channels; ++c) {
    const auto of_channel = Eigen::seqN(c, weight.size() / n_channels, n_channels);
    if (root(of_channel).isZero(0)) continue;
    std::vector<VectorXd> errors;
    for (const FittedWindow& window : windows) {
      if (window.residual.size() == 0) continue;
      errors.emplace_back(window.residual(of_channel).cwiseProduct(root(of_channel)));
    }
    sum += CorrelationTime(errors);
    ++n_held;
  }
  return n_held == 0 ? 1 : sum / n_held;
}

VectorXd SensorNoise(const SimulatorFactory& factory, const Dataset& logs, const ReadingModel& readings,
                     const std::vector<double>& z, int n_threads) {
  WindowReplayer replayer = MakeReplayer(factory, logs, readings, n_threads);
  const int n_steps = readings.ShortestWindow();
  std::vector<LogWindow> all, windows;
  for (const Episode& episode : logs.Episodes()) {
    for (int i = episode.begin + replayer.n_past_actions(); i + n_steps <= episode.end; i += n_steps) {
      all.push_back({i, n_steps, episode.begin});
    }
  }
  const size_t n = std::min<size_t>(all.size(), kNoiseWindows);
  for (size_t k = 0; k < n; ++k) {
    const LogWindow& window = all[k * all.size() / n];
    if (replayer.CanStart(window)) windows.push_back(window);
  }
  const VectorXd scale = ChannelScales(logs), smallest = (kSmallestNoise * scale.cwiseMax(1.0)).cwiseAbs2();
  const VectorXd step = readings.StartStep();
  VectorXd variance = (kNoiseGuess * scale).cwiseAbs2();
  std::vector<VectorXd> starts = LoggedStarts(replayer, windows);
  for (int round = 0; round < kNoiseRounds; ++round) {
    const WindowLikelihood likelihood(readings, variance, n_steps);
    starts = FitStarts(replayer, std::move(starts),
                       {.windows = windows,
                        .z = z,
                        .likelihood = likelihood,
                        .start_step = step,
                        .n_iterations = kNoiseStartIterations})
                 .starts;
    std::vector<FittedWindow> fitted;
    for (auto& linear : replayer.Linearize(windows, starts, z, {}, {}, std::vector<VectorXd>(windows.size(), step))) {
      if (linear.valid) fitted.push_back({std::move(linear.residual), std::move(linear.d_start)});
    }
    variance = NoiseVariance(readings, fitted, variance, smallest);
  }
  return variance.cwiseSqrt();
}

}  // namespace oted
