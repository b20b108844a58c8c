#include "oted/stages/design/replay/local_rates.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "oted/base/statistics.h"

namespace oted {
namespace {

constexpr std::array<int, 8> kHalfWidths = {2, 3, 4, 6, 8, 12, 16, 24};
constexpr int kJudgedRows = 400;

/// The parabola a + b t + c t^2 through values at t = -before, -before + 1, ...
Eigen::Vector3d Parabola(const std::vector<double>& values, int before) {
  const auto n = static_cast<Eigen::Index>(values.size());
  Eigen::MatrixXd powers(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double t = static_cast<double>(i) - before;
    powers.row(i) << 1, t, t * t;
  }
  const Eigen::Map<const Eigen::VectorXd> y(values.data(), n);
  if (n < 3) return {y[std::min<Eigen::Index>(before, n - 1)], n < 2 ? 0.0 : y[1] - y[0], 0};
  return powers.colPivHouseholderQr().solve(y);
}

}  // namespace

LocalRates::LocalRates(const Dataset& dataset, double period_s) : dataset_(dataset), period_s_(period_s) {
  for (const Episode& episode : dataset.Episodes()) {
    episode_of_.insert(episode_of_.end(), static_cast<size_t>(episode.size()), episode);
  }
}

LocalRates::Around LocalRates::ReadingsAround(int column, int row, int half_width) const {
  const Episode& episode = episode_of_[static_cast<size_t>(row)];
  const int first = std::max(episode.begin, row - half_width), last = std::min(episode.end, row + half_width);
  Around around{{}, row - first};
  const auto c = static_cast<size_t>(column);
  for (int k = first; k <= last; ++k) {
    around.values.push_back(k < episode.end ? dataset_.observations.row(k)[c]
                                            : dataset_.next_observations.row(k - 1)[c]);
  }
  return around;
}

int LocalRates::HalfWidth(int column) {
  const auto known = half_widths_.find(column);
  if (known != half_widths_.end()) return known->second;
  int best = kHalfWidths.front();
  double least = std::numeric_limits<double>::infinity();
  const int n = static_cast<int>(episode_of_.size()), stride = std::max(1, n / kJudgedRows);
  for (const int half_width : kHalfWidths) {
    std::vector<double> errors;
    for (int row = 0; row < n; row += stride) {
      Around around = ReadingsAround(column, row, half_width);
      if (static_cast<int>(around.values.size()) != 2 * half_width + 1) continue;
      // What the parabola through all leaves, divided by 1 - h, is what one through the others misses by.
      double m2 = 0, m4 = 0;
      for (int t = -half_width; t <= half_width; ++t) {
        m2 += t * t;
        m4 += std::pow(t, 4);
      }
      const double size = 2 * half_width + 1, leverage = m4 / (size * m4 - m2 * m2);
      const double value = around.values[static_cast<size_t>(half_width)];
      errors.push_back(std::abs(value - Parabola(around.values, around.before)[0]) / (1 - leverage));
    }
    if (errors.size() < 8) break;
    const double typical = Median(std::move(errors));
    if (!(typical < least)) continue;
    least = typical;
    best = half_width;
  }
  return half_widths_[column] = best;
}

double LocalRates::Rate(int column, int row) {
  const Around around = ReadingsAround(column, row, HalfWidth(column));
  return Parabola(around.values, around.before)[1] / period_s_;
}

double LocalRates::TurnRate(const std::array<int, 4>& orientation, int axis, int row) {
  int half_width = 0;
  for (const int column : orientation) half_width = std::max(half_width, HalfWidth(column));
  std::array<Around, 4> parts;
  for (size_t i = 0; i < 4; ++i) parts[i] = ReadingsAround(orientation[i], row, half_width);
  const auto now = static_cast<size_t>(parts[0].before);
  for (size_t k = 0; k < parts[0].values.size(); ++k) {
    double product = 0;
    for (const Around& part : parts) product += part.values[k] * part.values[now];
    for (Around& part : parts) part.values[k] *= product < 0 && k != now ? -1 : 1;
  }
  std::array<double, 4> q{}, rate{};
  double square = 0;
  for (size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d parabola = Parabola(parts[i].values, parts[i].before);
    q[i] = parabola[0];
    rate[i] = parabola[1] / period_s_;
    square += q[i] * q[i];
  }
  // omega = 2 conj(q) q', its vector part.
  const auto [w, x, y, z] = q;
  const auto [dw, dx, dy, dz] = rate;
  const std::array<double, 3> turn = {w * dx - x * dw - y * dz + z * dy, w * dy + x * dz - y * dw - z * dx,
                                      w * dz - x * dy + y * dx - z * dw};
  return 2 * turn[static_cast<size_t>(axis)] / std::max(square, 1e-12);
}

}  // namespace oted
