#include "oted/data/checks_frozen.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "oted/data/channel_series.h"

namespace oted {
namespace {

constexpr int kShortest = 5;       // rows without a change
constexpr double kLongerThan = 2;  // times the longest such stretch that chance gives
// Usual changes by which a reading jumps when it moves again, or which its velocity or position says it missed: of one
// that now and then repeats itself, such as a coarse encoder's, and of one that never does.
constexpr double kMissed = 5, kMissedByNoOther = 2;
// Of a joint at rest that was hit: how far it goes at most in the first period, by the rate at its end, and the least
// share of that rate in the period after. What a hung reading missed comes in one row.
constexpr double kFirstWay = 2, kGoesOn = 1 / 3.0;
constexpr double kRests = 0.1;      // of that rate: what a noisy or filtered one may show of a joint at rest
constexpr double kMoves = 0.2;      // of the usual speed: the least mean speed that is no rest
constexpr size_t kFlagValues = 10;  // a flag or a mode

/// A stretch of one series in which nothing changes: values[begin] ... values[end].
struct Stretch {
  size_t series = 0, begin = 0, end = 0;
  int Length() const { return static_cast<int>(end - begin); }
  bool operator==(const Stretch&) const = default;
};

using Series = std::vector<std::vector<double>>;

std::vector<Stretch> StretchesOf(const Series& series) {
  std::vector<Stretch> stretches;
  for (size_t e = 0; e < series.size(); ++e) {
    for (size_t i = 0; i + 1 < series[e].size();) {
      size_t k = i;
      while (k + 1 < series[e].size() && series[e][k + 1] == series[e][i]) ++k;
      if (k > i) stretches.push_back({e, i, k});
      i = std::max(k, i + 1);
    }
  }
  return stretches;
}

/// Root mean square, over all rows.
double TypicalChange(const Series& series) {
  double square = 0;
  size_t n = 0;
  for (const auto& values : series) {
    for (size_t i = 1; i < values.size(); ++i, ++n) square += std::pow(values[i] - values[i - 1], 2);
  }
  return n == 0 ? 0 : std::sqrt(square / static_cast<double>(n));
}

double TypicalSize(const Series& series) {
  double square = 0;
  size_t n = 0;
  for (const auto& values : series) {
    for (const double v : values) square += v * v;
    n += values.size();
  }
  return n == 0 ? 0 : std::sqrt(square / static_cast<double>(n));
}

/// The longest stretch without a change that is no wonder, where a share of the rows has none anyway.
double LongestByChance(const std::vector<Stretch>& stretches, size_t n_rows) {
  double still = 0;
  for (const Stretch& s : stretches) still += s.Length() < kShortest ? s.Length() : 0;
  const double share = std::clamp(still / static_cast<double>(n_rows), 1e-9, 0.99);
  return std::log(static_cast<double>(n_rows)) / -std::log(share);
}

class Frozen {
 public:
  Frozen(const Dataset& dataset, const TaskFacts& facts) : dataset_(dataset), facts_(facts) {
    for (int j = 0; j < dataset.obs_dim(); ++j) series_.push_back(SeriesOf(dataset, j));
    // Logs of another task may have fewer channels.
    n_rates_ = std::min(dataset.obs_dim(), static_cast<int>(facts.rate_of.size()));
    period_ = facts.control_period_s > 0 ? facts.control_period_s : dataset.period_s;
  }

  /// The stretches of one channel that the robot's motion contradicts.
  std::vector<Stretch> Of(int channel) const {
    const Series& own = series_[static_cast<size_t>(channel)];
    std::set<double> distinct;
    double low = own[0][0], high = low;
    for (const auto& values : own) {
      for (const double v : values) {
        if (distinct.size() <= kFlagValues) distinct.insert(v);
        low = std::min(low, v);
        high = std::max(high, v);
      }
    }
    if (distinct.size() <= kFlagValues) return {};
    const std::vector<Stretch> all = StretchesOf(own);
    const double chance = LongestByChance(all, static_cast<size_t>(dataset_.size()));
    const double missed = TypicalChange(own) * (chance < 1 ? kMissedByNoOther : kMissed);
    std::vector<Stretch> frozen;
    for (const Stretch& s : all) {
      const double value = own[s.series][s.begin];
      // On an extreme a reading is clipped.
      if (s.Length() < kShortest || s.Length() < kLongerThan * chance || value == low || value == high) continue;
      const bool is_contradicted = Jumps(own[s.series], s, missed) || PartnerMoves(channel, s, missed, chance < 1);
      if (is_contradicted && !IsAtRest(channel, s)) frozen.push_back(s);
    }
    return frozen;
  }

  /// Its stretches that are exactly one of `proven`.
  std::vector<Stretch> Like(int channel, const std::vector<Stretch>& proven) const {
    std::vector<Stretch> like;
    for (const Stretch& s : StretchesOf(series_[static_cast<size_t>(channel)])) {
      if (std::ranges::find(proven, s) != proven.end()) like.push_back(s);
    }
    return like;
  }

  int RowOf(const Stretch& stretch) const {
    return dataset_.Episodes()[stretch.series].begin + static_cast<int>(stretch.begin);
  }

 private:
  static bool Jumps(const std::vector<double>& values, const Stretch& s, double missed) {
    return s.end + 1 < values.size() && std::abs(values[s.end + 1] - values[s.end]) > missed;
  }

  /// Whether position and rate agree that the joint stands, and that a hit moves it from there.
  bool IsAtRest(int channel, const Stretch& s) const {
    if (period_ <= 0) return false;
    for (int v = 0; v < n_rates_; ++v) {
      const int p = facts_.rate_of[static_cast<size_t>(v)];
      if (p < 0 || (v != channel && p != channel)) continue;
      const auto& position = series_[static_cast<size_t>(p)][s.series];
      const auto& rate = series_[static_cast<size_t>(v)][s.series];
      if (s.end + 2 >= position.size()) continue;
      const auto from = static_cast<std::ptrdiff_t>(s.begin), to = static_cast<std::ptrdiff_t>(s.end) + 1;
      const auto stays_within = [&](const std::vector<double>& values, double value, double tolerance) {
        return std::all_of(values.begin() + from, values.begin() + to,
                           [&](double x) { return std::abs(x - value) <= tolerance; });
      };
      const double moved = std::abs(position[s.end + 1] - position[s.end]);
      const double first = std::abs(rate[s.end + 1]), next = std::abs(rate[s.end + 2]);
      const bool was_hit = moved <= kFirstWay * period_ * first && next >= kGoesOn * first;
      const bool stands = stays_within(rate, 0, kRests * first) && stays_within(position, position[s.begin], 0);
      if (was_hit && stands) return true;
    }
    return false;
  }

  /// Whether the channel that it is the rate of, or that is its rate, contradicts it.
  /// @param alone  the channel never repeats itself elsewhere: the way to and fro counts, and not how far it went
  bool PartnerMoves(int channel, const Stretch& s, double missed, bool alone) const {
    if (period_ <= 0) return false;
    for (int v = 0; v < n_rates_; ++v) {
      const int p = facts_.rate_of[static_cast<size_t>(v)];
      if (p < 0 || (v != channel && p != channel)) continue;
      const auto& partner = series_[static_cast<size_t>(v == channel ? p : v)][s.series];
      if (p == channel) {
        double at = 0, low = 0, high = 0, way = 0;
        for (size_t i = s.begin; i < s.end; ++i) {
          const double step = period_ * (partner[i] + partner[i + 1]) / 2;
          at += step;
          way += std::abs(step);
          low = std::min(low, at);
          high = std::max(high, at);
        }
        // A robot at rest has a sensor's bias, which adds up.
        const double usual = TypicalSize(series_[static_cast<size_t>(v)]);
        if ((alone ? way : high - low) > std::max(missed, kMoves * usual * period_ * s.Length())) return true;
      } else {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = s.begin; i < s.end; ++i) {
          const double rate = (partner[i + 1] - partner[i]) / period_;
          low = std::min(low, rate);
          high = std::max(high, rate);
        }
        if (high - low > missed) return true;
      }
    }
    return false;
  }

  const Dataset& dataset_;
  const TaskFacts& facts_;
  std::vector<Series> series_;
  double period_ = 0;
  int n_rates_ = 0;
};

}  // namespace

void CheckFrozen(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  if (!facts.flat_observations) return;
  const Frozen frozen(dataset, facts);
  std::vector<std::vector<Stretch>> found;
  std::vector<Stretch> proven;
  for (int j = 0; j < dataset.obs_dim(); ++j) {
    found.push_back(frozen.Of(j));
    proven.insert(proven.end(), found.back().begin(), found.back().end());
  }
  if (proven.empty()) return;
  std::vector<std::string> shown, channels;
  int first = -1;
  int64_t rows = 0;
  for (int j = 0; j < dataset.obs_dim(); ++j) {
    std::vector<Stretch>& stretches = found[static_cast<size_t>(j)];
    // Where others are frozen in the very same rows, a channel that happens to be where it was is, too.
    if (stretches.empty()) stretches = frozen.Like(j, proven);
    if (stretches.empty()) continue;
    const Stretch longest = *std::ranges::max_element(stretches, {}, &Stretch::Length);
    const int row = frozen.RowOf(longest);
    shown.push_back(
        fmt::format("{} (up to {} rows, from row {})", facts.ObservationName(j), longest.Length() + 1, row));
    channels.push_back(facts.ObservationName(j));
    for (const Stretch& s : stretches) {
      rows += s.Length();
      first = first < 0 ? frozen.RowOf(s) : std::min(first, frozen.RowOf(s));
    }
  }
  if (channels.empty()) return;
  findings.push_back(
      {.check = "frozen_channels",
       .severity = Severity::kWarning,
       .what =
           fmt::format("{} stand still and then jump, or stand still while the robot moves", fmt::join(shown, ", ")),
       .row = first,
       .count = rows,
       .channels = channels,
       .meaning = "a sensor or its bus hung: the rows repeat an old reading, and the design fits the jump",
       .remedy = "cut the episode there: end it before these rows and go on after them"});
}

}  // namespace oted
