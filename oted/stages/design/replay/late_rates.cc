#include "oted/stages/design/replay/late_rates.h"

#include <algorithm>
#include <cmath>

namespace oted {
namespace {

constexpr double kLongestLag = 0.1;  // [s]
constexpr int kMostLags = 20, kFewestLaggedRows = 200, kLaggedRows = 4000;
constexpr double kSurelyNearer = 0.8;  // of the error without a lag

double MiddleOf(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

std::vector<int> LateRates(const SimulatorSpec& spec, const Dataset& dataset) {
  std::vector<int> late(static_cast<size_t>(spec.obs_dim()), 0);
  const double period = spec.control_period_s;
  if (spec.rate_of.empty() || !(period > 0)) return late;
  const int n_lags = std::clamp(static_cast<int>(std::lround(kLongestLag / period)), 1, kMostLags);
  std::vector<int> all;
  for (const Episode& episode : dataset.Episodes()) {
    for (int row = episode.begin + n_lags + 1; row + 1 < episode.end; ++row) all.push_back(row);
  }
  if (all.size() < kFewestLaggedRows) return late;
  std::vector<int> rows;
  for (size_t k = 0; k < std::min<size_t>(all.size(), kLaggedRows); ++k) {
    rows.push_back(all[k * all.size() / std::min<size_t>(all.size(), kLaggedRows)]);
  }
  for (size_t c = 0; c < late.size(); ++c) {
    const int source = spec.rate_of[c];
    const bool known = !spec.reading_ages.empty() && spec.reading_ages[c] > 0;
    if (source < 0 || known) continue;
    const auto reading = [&](int row, size_t channel) { return dataset.observations(row, static_cast<int>(channel)); };
    // Of the difference over the two periods about each row, or over the one before it: a simulator of one physics step
    // per period logs the latter.
    const auto error = [&](int lag, bool about) {
      std::vector<double> off;
      for (const int row : rows) {
        const int at = row - lag;
        const double after = reading(about ? at + 1 : at, static_cast<size_t>(source));
        const double rate = (after - reading(at - 1, static_cast<size_t>(source))) / (about ? 2 * period : period);
        off.push_back(std::abs(reading(row, c) - rate));
      }
      return MiddleOf(off);
    };
    const double without = std::min(error(0, true), error(0, false));
    double best = without;
    for (int lag = 1; lag <= n_lags; ++lag) {
      const double with = error(lag, true);
      if (with < best) {
        best = with;
        late[c] = lag;
      }
    }
    if (!(best < kSurelyNearer * without)) late[c] = 0;
  }
  return late;
}

}  // namespace oted
