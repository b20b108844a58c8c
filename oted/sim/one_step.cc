#include "oted/sim/one_step.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <span>

#include "oted/base/error.h"
#include "oted/base/statistics.h"
#include "oted/sim/log_window.h"

namespace oted {
namespace {

constexpr int kLanes = 64;
constexpr int kLargestShift = 2;
constexpr int kFewestShifted = 20;
constexpr double kMovedBy = 1.1;  // ratio of the worst action's error to the best one's where an action moves a channel
constexpr double kLeastLeft = 1e-3;  // of the change: below it nothing is left
constexpr double kRounding = 1e-9;
constexpr int kNoiseDraws = 32;
constexpr double kNoiseAtBound = 2;  // of the sensors' noise: of many rows some lie so far off

/// Every k-th row, at most `most` of them.
std::vector<int> Spread(const std::vector<int>& rows, int most) {
  const size_t every = (rows.size() + static_cast<size_t>(most) - 1) / static_cast<size_t>(most);
  std::vector<int> some;
  for (size_t i = 0; i < rows.size(); i += std::max<size_t>(1, every)) some.push_back(rows[i]);
  return some;
}

std::unique_ptr<Simulator> NominalLanes(const SimulatorFactory& factory, int n_lanes, int n_threads) {
  auto simulator = factory.Make(n_lanes, n_threads);
  const std::vector<double> nominal = factory.parameters().Nominal();
  for (int lane = 0; lane < n_lanes; ++lane) simulator->SetParameters(lane, nominal);
  return simulator;
}

/// Where rows lead in the simulator.
struct Repeats {
  Array2<double> next;         ///< (rows, obs_dim), where known
  std::vector<char> is_known;  ///< by row
  int n_unsettable = 0, n_diverged = 0;
};

/// @param action  of a row
Repeats Repeat(Simulator& simulator, const Dataset& d, const std::vector<int>& rows,
               const std::function<std::span<const double>(int row)>& action_of) {
  const size_t act_dim = static_cast<size_t>(d.act_dim());
  Repeats result{Array2<double>(static_cast<int>(rows.size()), d.obs_dim()), std::vector<char>(rows.size(), 0)};
  std::vector<double> actions(static_cast<size_t>(simulator.n_lanes()) * act_dim);
  std::vector<int> lanes;
  std::vector<size_t> of_lane;  // index into rows
  const auto flush = [&] {
    simulator.Step(lanes, actions);
    for (size_t k = 0; k < lanes.size(); ++k) {
      if (simulator.status(lanes[k]) == LaneStatus::kDiverged) {
        ++result.n_diverged;
        continue;
      }
      result.is_known[of_lane[k]] = 1;
      std::ranges::copy(simulator.observation(lanes[k]), result.next.row(static_cast<int>(of_lane[k])).begin());
    }
    lanes.clear();
    of_lane.clear();
  };
  for (size_t i = 0; i < rows.size(); ++i) {
    const int lane = static_cast<int>(lanes.size());
    const LoggedHistory before = HistoryBefore(d, WindowAt(d, rows[i], 1));
    if (!simulator.SetStateFromLog(lane, d.observations.row(rows[i]), before)) {
      ++result.n_unsettable;
      continue;
    }
    const auto action = action_of(rows[i]);
    std::copy(action.begin(), action.end(), actions.begin() + static_cast<std::ptrdiff_t>(lanes.size() * act_dim));
    lanes.push_back(lane);
    of_lane.push_back(i);
    if (static_cast<int>(lanes.size()) == simulator.n_lanes()) flush();
  }
  if (!lanes.empty()) flush();
  return result;
}

OneStepError ErrorOf(const Dataset& d, const std::vector<int>& rows, const Repeats& repeats) {
  OneStepError result;
  result.n_unsettable = repeats.n_unsettable;
  result.n_diverged = repeats.n_diverged;
  result.n_rows = static_cast<int>(std::ranges::count(repeats.is_known, 1));
  result.rms_error.assign(static_cast<size_t>(d.obs_dim()), 0.0);
  result.rms_change = result.rms_error;
  std::vector<double> ratios;
  for (int j = 0; j < d.obs_dim() && result.n_rows > 0; ++j) {
    double errors = 0, changes = 0;
    for (size_t i = 0; i < rows.size(); ++i) {
      if (!repeats.is_known[i]) continue;
      const double logged = d.next_observations(rows[i], j);
      const double error = repeats.next(static_cast<int>(i), j) - logged, change = logged - d.observations(rows[i], j);
      errors += error * error;
      changes += change * change;
    }
    const size_t at = static_cast<size_t>(j);
    result.rms_error[at] = std::sqrt(errors / result.n_rows);
    result.rms_change[at] = std::sqrt(changes / result.n_rows);
    if (changes > 0) ratios.push_back(result.rms_error[at] / result.rms_change[at]);
  }
  result.median_ratio = Median(ratios);
  return result;
}

/// Sums of a least-squares fit of the logged change by what the simulator does under the mean action and by what the
/// action of a row adds to that,
/// each with a positive factor of its own: wrong gains and masses are the factors', not the shift's. (Turned round, the
/// action of another row fits any log that swings.)
struct TwoFactors {
  double own_own = 0, own_added = 0, added_added = 0, own_logged = 0, added_logged = 0, logged_logged = 0;

  void Add(double own, double added, double logged) {
    own_own += own * own;
    own_added += own * added;
    added_added += added * added;
    own_logged += own * logged;
    added_logged += added * logged;
    logged_logged += logged * logged;
  }
  /// Root of the share of the change's square that the fit leaves.
  double Left() const {
    if (logged_logged <= 0) return 0;
    double explained = own_own > 0 ? own_logged * own_logged / own_own : 0;
    const double added = own_own > 0 ? added_added - own_added * own_added / own_own : added_added;
    if (added > kRounding * added_added) {
      const double rest = own_own > 0 ? added_logged - own_added * own_logged / own_own : added_logged;
      if (rest > 0) explained += rest * rest / added;
    }
    return std::sqrt(std::max(0.0, 1 - explained / logged_logged));
  }
};

/// OneStepError::ratio_by_shift.
/// @param still  the rows under the mean action
std::map<int, double> RatioByShift(const Dataset& d, const std::vector<int>& rows, const Repeats& still,
                                   const std::map<int, Repeats>& by_shift) {
  const auto is_known = [&](size_t i) {
    return still.is_known[i] != 0 &&
           std::ranges::all_of(by_shift, [&](const auto& entry) { return entry.second.is_known[i] != 0; });
  };
  std::map<int, double> sums;
  int n_moved = 0;
  for (int j = 0; j < d.obs_dim(); ++j) {
    std::map<int, TwoFactors> fits;
    for (size_t i = 0; i < rows.size(); ++i) {
      if (!is_known(i)) continue;
      const int at = static_cast<int>(i);
      const double before = d.observations(rows[i], j);
      const double by_itself = still.next(at, j), change = d.next_observations(rows[i], j) - before;
      for (const auto& [shift, repeats] : by_shift) {
        fits[shift].Add(by_itself - before, repeats.next(at, j) - by_itself, change);
      }
    }
    double least = std::numeric_limits<double>::infinity(), most = 0;
    std::map<int, double> left;
    for (const auto& [shift, fit] : fits) {
      left[shift] = std::max(fit.Left(), kLeastLeft);
      least = std::min(least, left[shift]);
      most = std::max(most, left[shift]);
    }
    if (most < kMovedBy * least) continue;  // one action is as good as another here
    ++n_moved;
    for (const auto& [shift, some] : left) sums[shift] += std::log(some);
  }
  for (auto& [shift, sum] : sums) sum = std::exp(sum / n_moved);
  return sums;
}

}  // namespace

OneStepError MeasureOneStep(const SimulatorFactory& factory, const Dataset& dataset, int max_rows, int n_threads) {
  OTED_CHECK(factory.spec().can_set_state && max_rows >= 1);
  const auto simulator = NominalLanes(factory, kLanes, n_threads);
  std::vector<int> all, inner;
  for (const Episode& e : dataset.Episodes()) {
    for (int i = e.begin; i < e.end; ++i) {
      all.push_back(i);
      if (i - kLargestShift >= e.begin && i + kLargestShift < e.end) inner.push_back(i);
    }
  }
  const std::vector<int> some = Spread(all, max_rows);
  const auto own = [&](int row) { return dataset.actions.row(row); };
  OneStepError result = ErrorOf(dataset, some, Repeat(*simulator, dataset, some, own));
  if (static_cast<int>(inner.size()) < kFewestShifted) return result;
  inner = Spread(inner, max_rows);
  std::map<int, Repeats> by_shift;
  for (int shift = -kLargestShift; shift <= kLargestShift; ++shift) {
    by_shift[shift] = Repeat(*simulator, dataset, inner, [&](int row) { return dataset.actions.row(row + shift); });
  }
  std::vector<double> mean(static_cast<size_t>(dataset.act_dim()), 0.0);
  for (const int row : inner) {
    for (size_t a = 0; a < mean.size(); ++a) mean[a] += own(row)[a] / static_cast<double>(inner.size());
  }
  const Repeats still = Repeat(*simulator, dataset, inner, [&](int) { return std::span<const double>(mean); });
  result.ratio_by_shift = RatioByShift(dataset, inner, still, by_shift);
  return result;
}

std::optional<ActionShift> BetterShift(const OneStepError& error, double share) {
  const auto& ratios = error.ratio_by_shift;
  const auto best = std::ranges::min_element(ratios, {}, [](const auto& ratio) { return ratio.second; });
  if (best == ratios.end() || best->first == 0) return std::nullopt;
  const double own = ratios.at(0);
  if (best->second > share * own) return std::nullopt;
  return ActionShift{best->first, best->second, own};
}

TerminalAgreement CompareTerminals(const SimulatorFactory& factory, const Dataset& dataset,
                                   const std::vector<double>& noise_std, int max_rows, RngKey key) {
  OTED_CHECK(static_cast<int>(noise_std.size()) == dataset.obs_dim());
  const auto simulator = NominalLanes(factory, 1, 1);
  std::vector<int> terminal, other;
  for (int i = 0; i < dataset.size(); ++i) {
    (dataset.terminals[static_cast<size_t>(i)] ? terminal : other).push_back(i);
  }
  TerminalAgreement agreement;
  Rng rng = key.MakeRng();
  const auto noise_flips = [&](int row, bool ends) {
    if (std::ranges::all_of(noise_std, [](double std) { return std == 0; })) return false;
    std::vector<double> moved(noise_std.size());
    for (int draw = 0; draw < kNoiseDraws; ++draw) {
      for (size_t j = 0; j < moved.size(); ++j) {
        moved[j] = dataset.next_observations(row, static_cast<int>(j)) + kNoiseAtBound * noise_std[j] * rng.Normal();
      }
      if (simulator->EndsAt(0, moved) != std::optional(ends)) return true;
    }
    return false;
  };
  const auto compare = [&](int row, bool is_terminal, int& n, int& first) {
    const auto ends = simulator->EndsAt(0, dataset.next_observations.row(row));
    if (!ends || (*ends != is_terminal && noise_flips(row, *ends))) return;
    ++agreement.n_known;
    if (*ends != is_terminal && n++ == 0) first = row;
  };
  for (const int row : terminal) compare(row, true, agreement.n_unexplained, agreement.first_unexplained);
  for (const int row : Spread(other, max_rows)) compare(row, false, agreement.n_missed, agreement.first_missed);
  return agreement;
}

}  // namespace oted
