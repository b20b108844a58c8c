#include "oted/data/checks_missing.h"

#include <fmt/format.h>

#include <cmath>

#include "oted/data/channel_series.h"
#include "oted/data/checks_rates.h"

namespace oted {
namespace {

constexpr double kJudged = 0.5;  // of the usual change, that a row must show to be judged
constexpr double kRowSlack = 0.25;
constexpr double kRowLeft = 0.1;     // of the squared change, that one factor for all channels may leave
constexpr double kMostLong = 0.2;    // of the rows: beyond it the log has another rate
constexpr double kMostAgree = 0.75;  // of the rows, that must agree with their velocities
constexpr double kMostShort = 0.2;   // of the long ones, that may be as much too short: else it is noise
constexpr int kFewestLong = 3;

struct Channel {
  int position, velocity;
  double clip, change;  // of the velocity; root mean square of the position's, per row
};

class RowLengths {
 public:
  RowLengths(const Dataset& dataset, const TaskFacts& facts)
      : dataset_(dataset), period_(facts.control_period_s > 0 ? facts.control_period_s : dataset.period_s) {
    for (const RateAgreement& rate : CompareRates(dataset, facts.rate_of, period_)) {
      if (std::abs(rate.slope / period_ - 1) > kRowSlack) continue;
      double square = 0;
      for (int i = 0; i < dataset.size(); ++i) square += std::pow(Change(rate.position, i), 2) / dataset.size();
      channels_.push_back({rate.position, rate.velocity, ClipOf(dataset, rate.velocity), std::sqrt(square)});
    }
  }

  double period_s() const { return period_; }

  /// [control periods]; 0: it says nothing.
  double Of(int row) const {
    double xx = 0, xy = 0, yy = 0;
    int n = 0;
    for (const Channel& c : channels_) {
      const double before = dataset_.observations(row, c.velocity), after = dataset_.next_observations(row, c.velocity);
      const double change = Change(c.position, row);
      if (Wraps(change) || std::abs(before) >= c.clip || std::abs(after) >= c.clip || c.change <= 0) continue;
      const double x = period_ * (before + after) / 2 / c.change, y = change / c.change;
      xx += x * x;
      xy += x * y;
      yy += y * y;
      ++n;
    }
    if (xx <= kJudged * kJudged * n || n == 0) return 0;
    const double factor = xy / xx;
    return yy - factor * xy < kRowLeft * yy ? factor : 0;
  }

 private:
  double Change(int position, int row) const {
    return dataset_.next_observations(row, position) - dataset_.observations(row, position);
  }

  const Dataset& dataset_;
  const double period_;
  std::vector<Channel> channels_;
};

}  // namespace

void CheckMissingRows(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  if (!facts.flat_observations || facts.rate_of.empty()) return;
  const RowLengths lengths(dataset, facts);
  if (lengths.period_s() <= 0) return;
  const auto near = [](double length, double wanted) { return std::abs(length - wanted) < kRowSlack; };
  int n = 0, n_agree = 0, n_long = 0, n_short = 0, first = -1;
  for (const Episode& e : dataset.Episodes()) {
    for (int i = e.begin + 1; i + 1 < e.end; ++i) {
      const double length = lengths.Of(i);
      if (length == 0) continue;
      ++n;
      n_agree += near(length, 1);
      n_short += length < 0.5;
      // A lost row lies between others that are as they should be.
      if (length < 2 - kRowSlack || !near(length, std::round(length))) continue;
      if (!near(lengths.Of(i - 1), 1) || !near(lengths.Of(i + 1), 1)) continue;
      if (n_long++ == 0) first = i;
    }
  }
  if (n_long < kFewestLong || n_long > kMostLong * n || n_agree < kMostAgree * n || n_short > kMostShort * n_long)
    return;
  findings.push_back({.check = kMissingRows,
                      .severity = Severity::kWarning,
                      .what = fmt::format("in {} of {} rows all positions move two or more times as far as their "
                                          "velocities say, in the others as far",
                                          n_long, n),
                      .row = first,
                      .count = n_long,
                      .meaning = "rows were lost there: the robot moved on, the log did not",
                      .remedy = "give the log its times (a column 'time'), then it is cut there; or end the episode"});
}

}  // namespace oted
