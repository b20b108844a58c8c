#include "oted/stages/design/trajectories/noise_estimate.h"

#include <algorithm>
#include <utility>

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kMedianOfSquaredNormal = 0.4549;
constexpr double kLeastFreedom = 1e-3;  // below it a residual is that of the fit and not of the reading
constexpr int kLeverageRounds = 3;

/// 1 - h_i of every number of a window.
VectorXd Freedom(const FittedWindow& window, const VectorXd& variance) {
  const Eigen::Index n_channels = variance.size();
  MatrixXd whitened = window.d_start;
  for (Eigen::Index i = 0; i < whitened.rows(); i += n_channels) {
    whitened.middleRows(i, n_channels).array().colwise() /= variance.array().sqrt();
  }
  const MatrixXd normal = whitened.transpose() * whitened;
  const MatrixXd solved = normal.ldlt().solve(whitened.transpose());
  return (1 - whitened.transpose().cwiseProduct(solved).colwise().sum().transpose().array()).max(0.0);
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

VectorXd NoiseVariance(const std::vector<FittedWindow>& windows, const VectorXd& guess, const VectorXd& smallest) {
  const Eigen::Index n_channels = guess.size();
  VectorXd variance = guess.cwiseMax(smallest);
  for (int round = 0; round < kLeverageRounds; ++round) {
    std::vector<std::vector<std::pair<double, double>>> of_channel(static_cast<size_t>(n_channels));
    for (const FittedWindow& window : windows) {
      if (window.residual.size() == 0) continue;
      const VectorXd freedom = Freedom(window, variance);
      for (Eigen::Index i = 0; i < freedom.size(); ++i) {
        const Eigen::Index c = i % n_channels;
        const double square = window.residual[i] * window.residual[i];
        if (freedom[i] < kLeastFreedom || square <= smallest[c]) continue;
        of_channel[static_cast<size_t>(c)].emplace_back(square / freedom[i], freedom[i]);
      }
    }
    for (Eigen::Index c = 0; c < n_channels; ++c) {
      auto& squares = of_channel[static_cast<size_t>(c)];
      variance[c] =
          squares.empty() ? smallest[c] : std::max(smallest[c], WeightedMedian(squares) / kMedianOfSquaredNormal);
    }
  }
  return variance;
}

}  // namespace oted
