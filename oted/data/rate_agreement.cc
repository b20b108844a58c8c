#include "oted/data/rate_agreement.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "oted/base/statistics.h"
#include "oted/data/channel_series.h"

namespace oted {
namespace {

constexpr int kFewestPairs = 20;
constexpr double kLongestLag_s = 0.05;
constexpr double kLagStep = 0.25;  // [rows]
// A velocity at the end of a row, or from differences, is half a row off; so much is no lag. Between rows noise
// averages out: a lag of one row is found somewhat below.
constexpr double kNoLag = 0.5, kLag = 0.75;
constexpr double kLagGain = 0.6;       // what a lag must leave of the squared difference
constexpr size_t kBlocks = 10;         // of rows, that tell how sure the mean difference is
constexpr double kSureOffset = 5.0;    // standard errors
constexpr double kLeastOffset = 0.05;  // of the velocity's size
constexpr double kOfScatter = 0.5;     // of the differences' own scatter

/// Sums over rows of y (change of the position) and x (mean velocity of the row, read `lag` rows later).
struct Sums {
  double xy = 0, xx = 0, yy = 0, xxxx = 0;
  int n = 0;
  double Support() const { return xxxx > 0 ? xx * xx / xxxx : 0; }
  double Slope() const { return xx > 0 ? xy / xx : 0; }
  double Correlation() const { return xx > 0 && yy > 0 ? xy / std::sqrt(xx * yy) : 0; }
  /// Share of y's square that the best slope leaves.
  double Left() const { return 1 - Correlation() * Correlation(); }
};

struct Pair {
  std::vector<std::vector<double>> position, velocity;
  double clip;
};

/// f(mean velocity, change of the position) of each row that has both, the velocity read `lag` rows later.
template <class F>
void ForRows(const Pair& pair, double lag, int margin, const F& f) {
  const int whole = static_cast<int>(std::floor(lag));
  const double part = lag - whole;
  for (size_t e = 0; e < pair.position.size(); ++e) {
    const auto &p = pair.position[e], &v = pair.velocity[e];
    const auto at = [&](int i) {
      const size_t k = static_cast<size_t>(i + whole);
      return part == 0 ? v[k] : (1 - part) * v[k] + part * v[k + 1];
    };
    for (int i = margin; i + 1 + margin < static_cast<int>(p.size()); ++i) {
      const size_t k = static_cast<size_t>(i);
      if (std::abs(v[k]) >= pair.clip || std::abs(v[k + 1]) >= pair.clip) continue;
      const double y = p[k + 1] - p[k], x = (at(i) + at(i + 1)) / 2;
      if (!Wraps(y)) f(x, y);
    }
  }
}

Sums Sum(const Pair& pair, double lag, int margin) {
  Sums sums;
  ForRows(pair, lag, margin, [&](double x, double y) {
    sums.xy += x * y;
    sums.xx += x * x;
    sums.xxxx += x * x * x * x;
    sums.yy += y * y;
    ++sums.n;
  });
  return sums;
}

/// By how much the velocity is larger than the position moves, on average: noise, filters and lags have no part in it.
/// Between coarse rows a gait moves otherwise than its velocities at the rows say, row by row by far more than on
/// average.
double OffsetOf(const Pair& pair, double period_s) {
  std::vector<double> off;
  double square = 0;
  ForRows(pair, 0, 0, [&](double x, double y) {
    off.push_back(x - y / period_s);
    square += x * x;
  });
  std::vector<double> sums(kBlocks, 0.0), counts(kBlocks, 0.0);
  for (size_t i = 0; i < off.size(); ++i) {
    sums[i * kBlocks / off.size()] += off[i];
    ++counts[i * kBlocks / off.size()];
  }
  double mean = 0, spread = 0;
  for (size_t b = 0; b < kBlocks; ++b) mean += sums[b] / counts[b] / kBlocks;
  for (size_t b = 0; b < kBlocks; ++b) spread += std::pow(sums[b] / counts[b] - mean, 2);
  const double error = std::sqrt(spread / (kBlocks * (kBlocks - 1)));
  const double least = kLeastOffset * std::sqrt(square / static_cast<double>(off.size()));
  return std::abs(mean) > std::max({kSureOffset * error, least, kOfScatter * StandardDeviation(off)}) ? mean : 0;
}

RateAgreement Compare(const Pair& pair, double period_s) {
  RateAgreement rate;
  const int most = period_s > 0 ? std::clamp(static_cast<int>(kLongestLag_s / period_s), 2, 25) : 3;
  const Sums all = Sum(pair, 0, 0);
  rate.slope = all.Slope();
  rate.correlation = all.Correlation();
  rate.support = all.Support();
  if (all.n < kFewestPairs) return RateAgreement{};
  // One row more at each side than is read, as a lag between rows reads two.
  const int margin = most + 1;
  if (Sum(pair, 0, margin).n < kFewestPairs) return rate;
  double best = 1, prompt = 1;
  for (double lag = -most; lag <= most; lag += kLagStep) {
    const Sums sums = Sum(pair, lag, margin);
    const double left = sums.Slope() * all.Slope() > 0 ? sums.Left() : 1;
    if (std::abs(lag) <= kNoLag) prompt = std::min(prompt, left);
    if (left < best) {
      best = left;
      rate.lag = lag;
    }
  }
  rate.lag_gain = prompt > 0 ? best / prompt : 1;
  const bool agrees = period_s > 0 && rate.correlation > kClearCorrelation && Near(rate.slope, period_s, kUnitSlack);
  if (agrees) rate.offset = OffsetOf(pair, period_s);
  return rate;
}

Pair PairOf(const Dataset& dataset, int position, int velocity) {
  return {SeriesOf(dataset, position), SeriesOf(dataset, velocity), ClipOf(dataset, velocity)};
}

}  // namespace

bool Near(double value, double wanted, double slack) { return std::abs(value - wanted) < slack * std::abs(wanted); }

bool Wraps(double change) { return std::abs(std::abs(change) - 2 * std::numbers::pi) < std::numbers::pi / 2; }

bool RateAgreement::IsShifted() const { return std::abs(lag) >= kLag && lag_gain < kLagGain; }

RateAgreement CompareRate(const Dataset& dataset, int position, int velocity, double period_s) {
  return Compare(PairOf(dataset, position, velocity), period_s);
}

std::vector<RateAgreement> CompareRates(const Dataset& dataset, const std::vector<int>& rate_of, double period_s) {
  std::vector<RateAgreement> rates;
  for (int velocity = 0; velocity < static_cast<int>(rate_of.size()); ++velocity) {
    const int position = rate_of[static_cast<size_t>(velocity)];
    if (position < 0 || velocity >= dataset.obs_dim() || position >= dataset.obs_dim()) continue;
    RateAgreement rate = CompareRate(dataset, position, velocity, period_s);
    if (rate.slope == 0) continue;
    rate.velocity = velocity;
    rate.position = position;
    rates.push_back(rate);
  }
  return rates;
}

double PeriodByRates(const std::vector<RateAgreement>& rates) {
  std::vector<double> periods;
  for (const RateAgreement& rate : rates) {
    if (rate.correlation > kClearCorrelation) periods.push_back(rate.slope);
  }
  // A few clear channels among vague ones may be clear for another reason: a clip whose edge noise has smeared.
  if (periods.empty() || 2 * periods.size() < rates.size()) return 0;
  const double median = Median(periods);
  const auto agrees = [&](double period) { return Near(period, median, kUnitSlack); };
  return 2 * std::ranges::count_if(periods, agrees) > static_cast<ptrdiff_t>(periods.size()) ? median : 0;
}

}  // namespace oted
