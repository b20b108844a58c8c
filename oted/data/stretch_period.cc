#include "oted/data/stretch_period.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <span>

#include "oted/base/statistics.h"
#include "oted/data/channel_series.h"
#include "oted/data/rate_agreement.h"

namespace oted {
namespace {

constexpr int kLengths[] = {8, 16, 32, 64};  // [rows]
constexpr size_t kFewestStretches = 20;
constexpr double kLeft = 0.005;      // of the squares: noise makes a slope smaller by that share at most
constexpr double kSameSlope = 0.01;  // of the period, beside three standard errors: velocities that agree

/// How far a stretch moves per unit of its period: the trapezoid rule, which is short where few rows make a swing, with
/// Gregory's corrections at the ends.
double Sum(std::span<const double> velocity) {
  constexpr double kOfEnd[] = {3 / 8.0, 7 / 6.0, 23 / 24.0};
  double sum = 0;
  for (size_t i = 0; i < velocity.size(); ++i) {
    const size_t from_end = std::min(i, velocity.size() - 1 - i);
    sum += (from_end < std::size(kOfEnd) ? kOfEnd[from_end] : 1) * velocity[i];
  }
  return sum;
}

struct Slope {
  double value = 0, error = 0;
};

/// The slope over stretches of that length, and the share of the squares that it leaves; 1 of too few.
struct OfLength {
  Slope slope;
  double left = 1;
};

OfLength Compare(const std::vector<std::vector<double>>& positions, const std::vector<std::vector<double>>& velocities,
                 double clip, int n_rows) {
  std::vector<double> sums, moved;
  const auto length = static_cast<size_t>(n_rows);
  for (size_t e = 0; e < positions.size(); ++e) {
    for (size_t begin = 0; begin + length < positions[e].size(); begin += length) {
      const std::span<const double> p(&positions[e][begin], length + 1), v(&velocities[e][begin], length + 1);
      bool is_whole = std::ranges::all_of(v, [&](double x) { return std::abs(x) < clip; });
      for (size_t i = 0; i < length; ++i) is_whole = is_whole && !Wraps(p[i + 1] - p[i]);
      if (!is_whole) continue;
      sums.push_back(Sum(v));
      moved.push_back(p[length] - p[0]);
    }
  }
  if (sums.size() < kFewestStretches) return {};
  const auto n = static_cast<double>(sums.size());
  double x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  for (size_t i = 0; i < sums.size(); ++i) {
    x += sums[i] / n;
    y += moved[i] / n;
  }
  for (size_t i = 0; i < sums.size(); ++i) {
    xx += (sums[i] - x) * (sums[i] - x);
    xy += (sums[i] - x) * (moved[i] - y);
    yy += (moved[i] - y) * (moved[i] - y);
  }
  if (!(xx > 0 && yy > 0)) return {};
  const double left = 1 - xy * xy / (xx * yy);
  return {{xy / xx, std::abs(xy / xx) * std::sqrt(left / (1 - left) / (n - 2))}, left};
}

/// Of the length that leaves least: over short ones sensors' noise counts, over long ones a motion that comes back.
std::optional<Slope> SlopeOf(const Dataset& dataset, int position, int velocity) {
  const std::vector<std::vector<double>> p = SeriesOf(dataset, position), v = SeriesOf(dataset, velocity);
  const double clip = ClipOf(dataset, velocity);
  OfLength best;
  for (const int n_rows : kLengths) {
    const OfLength of_length = Compare(p, v, clip, n_rows);
    if (of_length.left < best.left) best = of_length;
  }
  return best.left < kLeft ? std::optional(best.slope) : std::nullopt;
}

}  // namespace

std::optional<double> PeriodByStretches(const Dataset& dataset, const std::vector<int>& rate_of,
                                        const std::vector<int>& velocities) {
  std::vector<Slope> slopes;
  std::vector<double> values;
  for (const int velocity : velocities) {
    const std::optional<Slope> slope = SlopeOf(dataset, rate_of[static_cast<size_t>(velocity)], velocity);
    if (!slope) continue;
    slopes.push_back(*slope);
    values.push_back(slope->value);
  }
  if (values.size() < 2 || 2 * values.size() < velocities.size()) return std::nullopt;
  const double median = Median(values);
  const bool agree = std::ranges::all_of(
      slopes, [&](const Slope& s) { return std::abs(s.value - median) < kSameSlope * std::abs(median) + 3 * s.error; });
  return agree ? std::optional(median) : std::nullopt;
}

}  // namespace oted
