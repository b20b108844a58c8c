#include "oted/data/checks_channels.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

namespace oted {
namespace {

constexpr double kOnBound = 1e-6;            // of the action range
constexpr double kClippedActionNote = 0.05;  // share of a channel's rows at a bound
constexpr double kClippedActionWarning = 0.5;
constexpr double kHardlyTurned = 1 - 1e-5;  // of a quaternion's component
constexpr double kUnusedRange = 0.01;       // of the range, that no action leaves
constexpr double kClippedRows = 0.5;        // share of rows with a clipped observation: above it a warning
constexpr double kClippedShare = 1e-3;      // of a channel's rows on its very extreme: a clip
constexpr int kRowsForPrecision = 200;      // fewer say nothing about resolution
constexpr double kMaxSteps = 20000;         // a grid finer than this share of the range is no matter
constexpr double kCoarseStep = 0.1;         // of the root mean square change per row: above it a warning
constexpr size_t kFewValues = 10;           // a flag or a mode, not a measurement

std::vector<double> Column(const Array2<double>& m, int j) {
  std::vector<double> column(static_cast<size_t>(m.rows()));
  for (int i = 0; i < m.rows(); ++i) column[static_cast<size_t>(i)] = m(i, j);
  return column;
}

/// What a column's distinct values tell.
struct Resolution {
  size_t n_distinct = 0;
  double low = 0, high = 0;
  double step = 0;       // of the grid that all values lie on; 0: none
  bool is_half = false;  // every value is a half-precision float, and they lie on no grid
  bool is_constant() const { return n_distinct <= 1; }
};

bool IsHalf(double v) {
  int exponent = 0;
  const double mantissa = std::frexp(v, &exponent);  // in [0.5, 1)
  const double units = std::ldexp(mantissa, 11);
  return v == 0 || (units == std::nearbyint(units) && exponent >= -13 && exponent <= 16);
}

Resolution MeasureResolution(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  Resolution r;
  r.n_distinct = values.size();
  r.low = values.front();
  r.high = values.back();
  if (r.is_constant()) return r;
  double smallest = r.high - r.low;
  // float32 rounding makes one step of a grid several values: what is that near is one.
  const double rounding = 1e-6 * std::max(std::abs(r.low), std::abs(r.high));
  for (size_t i = 1; i < values.size(); ++i) {
    const double gap = values[i] - values[i - 1];
    if (gap > rounding) smallest = std::min(smallest, gap);
  }
  // One gap is a poor measure of the step; the distance to ever farther values refines it.
  double step = smallest;
  for (const double v : values) {
    const double n = std::nearbyint((v - r.low) / step);
    if (n >= 1) step = (v - r.low) / n;
  }
  const double n_steps = (r.high - r.low) / step;
  const bool on_grid = n_steps <= kMaxSteps && std::all_of(values.begin(), values.end(), [&](double v) {
                         const double steps = (v - r.low) / step;
                         return std::abs(steps - std::nearbyint(steps)) < 0.02 + rounding / step;
                       });
  if (on_grid && rounding < 0.2 * step) r.step = step;
  r.is_half = r.step == 0 && std::all_of(values.begin(), values.end(), IsHalf);
  return r;
}

double RmsChange(const Dataset& d, int j) {
  double square = 0;
  for (int i = 0; i < d.size(); ++i) {
    const double change = d.next_observations(i, j) - d.observations(i, j);
    square += change * change / d.size();
  }
  return std::sqrt(square);
}

class ChannelChecks {
 public:
  ChannelChecks(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings)
      : d_(dataset), facts_(facts), findings_(findings) {}

  /// Whether a quaternion's component is at its bound, but for digits that were cut, because nothing has turned.
  bool IsTurnOfNone(int j, double bound) const {
    return std::abs(bound) > kHardlyTurned && std::ranges::any_of(facts_.bodies, [&](const TurningBody& body) {
             return std::ranges::find(body.orientation, j) != body.orientation.end();
           });
  }

  void Observations() {
    std::vector<std::string> constant;
    std::vector<int> at_clip(static_cast<size_t>(d_.size()), 0);
    std::vector<std::string> clipped, half, fine, coarse;
    std::vector<double> bounds;
    for (int j = 0; j < d_.obs_dim(); ++j) {
      const std::vector<double> column = Column(d_.observations, j);
      const Resolution r = MeasureResolution(column);
      const std::string name = facts_.ObservationName(j);
      if (r.is_constant()) {
        constant.push_back(name);
        continue;
      }
      if (d_.size() >= kRowsForPrecision && r.n_distinct > kFewValues) {
        if (r.is_half) half.push_back(name);
        if (r.step > 0) {
          const bool is_coarse = r.step > kCoarseStep * RmsChange(d_, j);
          (is_coarse ? coarse : fine).push_back(fmt::format("{} (step {:.3g})", name, r.step));
        }
      }
      if (r.step > 0) continue;  // a grid meets its extremes often
      for (const double bound : {r.low, r.high}) {
        const auto n = std::count(column.begin(), column.end(), bound);
        if (n < 3 || static_cast<double>(n) < kClippedShare * d_.size() || IsTurnOfNone(j, bound)) continue;
        if (clipped.empty() || clipped.back() != name) clipped.push_back(name);
        if (std::find(bounds.begin(), bounds.end(), bound) == bounds.end()) bounds.push_back(bound);
        for (int i = 0; i < d_.size(); ++i) at_clip[static_cast<size_t>(i)] |= column[static_cast<size_t>(i)] == bound;
      }
    }
    Constant(constant, "observation");
    if (!clipped.empty()) {
      const auto n = std::count(at_clip.begin(), at_clip.end(), 1);
      const double share = static_cast<double>(n) / d_.size();
      const auto first = std::find(at_clip.begin(), at_clip.end(), 1) - at_clip.begin();
      findings_.push_back(
          {.check = "clipped_observations",
           .severity = share > kClippedRows ? Severity::kWarning : Severity::kNote,
           .what = fmt::format(
               "in {} rows ({:.1f} %) a channel lies on its very extreme ({:.6g}), which {} again "
               "and again",
               n, 100 * share, fmt::join(bounds, ", "),
               clipped.size() == 1 ? "one channel reaches" : fmt::format("{} channels reach", clipped.size())),
           .row = static_cast<int>(first),
           .count = n,
           .channels = clipped,
           .meaning = "a clipped reading does not say what the state was: no window is replayed from such a row",
           .remedy = "log the unclipped quantity if you can; otherwise none needed"});
    }
    Resolved(half, fine, coarse);
  }

  void Actions() {
    std::vector<std::string> constant;
    for (int j = 0; j < d_.act_dim(); ++j) {
      const std::vector<double> column = Column(d_.actions, j);
      const auto [low, high] = std::minmax_element(column.begin(), column.end());
      if (*low == *high) {
        constant.push_back(facts_.ActionName(j));
      } else if (facts_.continuous_actions) {
        Action(j, column, *low, *high);
      }
    }
    Constant(constant, "action");
    Join("clipped_actions", Severity::kWarning, clipped_much_,
         "the motors were saturated most of the time: what is beyond the bound was not logged, and a motor gain is "
         "hard to tell from it",
         "log also with smaller actions");
    Join("clipped_actions", Severity::kNote, clipped_, "saturated actions; the simulator is driven with the same ones",
         "none needed");
    Join("actions_outside_bounds", Severity::kWarning, outside_,
         "the simulator clamps these actions at its actuators' range; the logged robot may not have",
         "check unit and scale of the actions, task.action_range, or the actuators' ctrlrange in the model",
         first_outside_);
    Join("small_actions", Severity::kWarning, small_,
         "less than a hundredth of the actuators' range is used: most likely another unit than the task's",
         "check unit and scale of the actions");
  }

 private:
  void Action(int j, const std::vector<double>& column, double lowest, double highest) {
    const size_t at = static_cast<size_t>(j);
    const bool known = at < facts_.action_low.size() && std::isfinite(facts_.action_low[at]) &&
                       std::isfinite(facts_.action_high[at]) && facts_.action_low[at] < facts_.action_high[at];
    const double low = known ? facts_.action_low[at] : lowest, high = known ? facts_.action_high[at] : highest;
    const double margin = kOnBound * (high - low);
    const std::string name = facts_.ActionName(j);
    int n_at = 0, n_outside = 0, first = -1;
    for (size_t i = 0; i < column.size(); ++i) {
      n_at += column[i] <= low + margin || column[i] >= high - margin;
      if (column[i] >= low - margin && column[i] <= high + margin) continue;
      if (n_outside++ == 0) first = static_cast<int>(i);
    }
    const double n = static_cast<double>(column.size()), share = n_at / n;
    if (n_outside > 0) {
      outside_.push_back(fmt::format("{} ({:.1f} % of rows, range [{:.4g}, {:.4g}], bounds [{:.4g}, {:.4g}])", name,
                                     100 * n_outside / n, lowest, highest, low, high));
      first_outside_ = first_outside_ < 0 ? first : std::min(first_outside_, first);
    }
    // Two distinct values are a switch, and without known bounds a channel's extremes are trivially its own.
    const bool is_clipped = share > kClippedActionNote && n_at > 2;
    if (is_clipped) {
      (share > kClippedActionWarning && known ? clipped_much_ : clipped_)
          .push_back(fmt::format("{} ({:.1f} % of rows at {})", name, 100 * share, known ? "a bound" : "an extreme"));
    }
    const double used = std::max(std::abs(lowest), std::abs(highest));
    if (known && used < kUnusedRange * std::max(std::abs(low), std::abs(high))) {
      small_.push_back(fmt::format("{} (at most {:.3g} of {:.3g})", name, used, high));
    }
  }

  void Join(const char* check, Severity severity, const std::vector<std::string>& channels, const char* meaning,
            const char* remedy, int row = -1) {
    if (channels.empty()) return;
    findings_.push_back({.check = check,
                         .severity = severity,
                         .what = fmt::format("{}", fmt::join(channels, "; ")),
                         .row = row,
                         .count = static_cast<int64_t>(channels.size()),
                         .channels = channels,
                         .meaning = meaning,
                         .remedy = remedy});
  }

  void Constant(const std::vector<std::string>& channels, const char* kind) {
    if (channels.empty()) return;
    findings_.push_back(
        {.check = "constant_channels",
         .severity = Severity::kWarning,
         .what = fmt::format("{} {} channel(s) never change: {}", channels.size(), kind, fmt::join(channels, ", ")),
         .row = -1,
         .count = static_cast<int64_t>(channels.size()),
         .channels = channels,
         .meaning = "nothing that acts through them can be identified; a simulator in which they move looks wrong in "
                    "every row",
         .remedy = "check that the column is the one that you mean, and that the sensor or motor was connected"});
  }

  void Resolved(const std::vector<std::string>& half, const std::vector<std::string>& fine,
                const std::vector<std::string>& coarse) {
    Join("half_precision", Severity::kWarning, half,
         "values were stored in half precision (11 bits): the change per step, which the design compares, is rounded "
         "to few digits",
         "write the log in float32 or float64");
    Join("quantised", Severity::kNote, coarse,
         "the steps of the grid are more than a tenth of the usual change per row: a discriminator tells logs from "
         "simulator by it; the default method takes step / sqrt(12) for the least noise of such a channel",
         "none needed for the default method; do not smooth");
    Join("quantised", Severity::kNote, fine, "all values lie on a grid, fine enough beside the change per row",
         "none needed");
  }

  const Dataset& d_;
  const TaskFacts& facts_;
  std::vector<Finding>& findings_;
  std::vector<std::string> clipped_much_, clipped_, outside_, small_;
  int first_outside_ = -1;
};

}  // namespace

double GridStep(std::span<const double> values) {
  const Resolution r = MeasureResolution({values.begin(), values.end()});
  return r.n_distinct > kFewValues ? r.step : 0;
}

void CheckChannels(const Dataset& dataset, const TaskFacts& facts, std::vector<Finding>& findings) {
  ChannelChecks checks(dataset, facts, findings);
  if (facts.flat_observations) checks.Observations();
  checks.Actions();
}

}  // namespace oted
