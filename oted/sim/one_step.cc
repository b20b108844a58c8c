#include "oted/sim/one_step.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/sim/log_window.h"

namespace oted {
namespace {

constexpr int kLanes = 64;
constexpr int kLargestShift = 2;
constexpr int kFewestShifted = 20;

/// Every k-th row, at most `most` of them.
std::vector<int> Spread(const std::vector<int>& rows, int most) {
  const size_t every = (rows.size() + static_cast<size_t>(most) - 1) / static_cast<size_t>(most);
  std::vector<int> some;
  for (size_t i = 0; i < rows.size(); i += std::max<size_t>(1, every)) some.push_back(rows[i]);
  return some;
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// One pass over `rows`, row i with the action of row i + `shift`.
OneStepError Measure(Simulator& simulator, const Dataset& d, const std::vector<int>& rows, int shift) {
  const size_t obs_dim = static_cast<size_t>(d.obs_dim()), act_dim = static_cast<size_t>(d.act_dim());
  OneStepError result;
  result.rms_error.assign(obs_dim, 0.0);
  result.rms_change.assign(obs_dim, 0.0);
  std::vector<double> actions(static_cast<size_t>(simulator.n_lanes()) * act_dim);
  std::vector<int> lanes, lane_rows;
  const auto flush = [&] {
    simulator.Step(lanes, actions);
    for (size_t k = 0; k < lanes.size(); ++k) {
      if (simulator.status(lanes[k]) == LaneStatus::kDiverged) {
        ++result.n_diverged;
        continue;
      }
      ++result.n_rows;
      const auto simulated = simulator.observation(lanes[k]);
      for (size_t j = 0; j < obs_dim; ++j) {
        const double logged = d.next_observations.row(lane_rows[k])[j];
        const double error = simulated[j] - logged, change = logged - d.observations.row(lane_rows[k])[j];
        result.rms_error[j] += error * error;
        result.rms_change[j] += change * change;
      }
    }
    lanes.clear();
    lane_rows.clear();
  };
  for (const int row : rows) {
    const int lane = static_cast<int>(lanes.size());
    const LoggedHistory before = HistoryBefore(d, WindowAt(d, row, 1));
    if (!simulator.SetStateFromLog(lane, d.observations.row(row), before)) {
      ++result.n_unsettable;
      continue;
    }
    const auto action = d.actions.row(row + shift);
    std::copy(action.begin(), action.end(), actions.begin() + static_cast<std::ptrdiff_t>(lanes.size() * act_dim));
    lanes.push_back(lane);
    lane_rows.push_back(row);
    if (static_cast<int>(lanes.size()) == simulator.n_lanes()) flush();
  }
  if (!lanes.empty()) flush();
  std::vector<double> ratios;
  for (size_t j = 0; j < obs_dim && result.n_rows > 0; ++j) {
    result.rms_error[j] = std::sqrt(result.rms_error[j] / result.n_rows);
    result.rms_change[j] = std::sqrt(result.rms_change[j] / result.n_rows);
    if (result.rms_change[j] > 0) ratios.push_back(result.rms_error[j] / result.rms_change[j]);
  }
  result.median_ratio = Median(ratios);
  return result;
}

}  // namespace

OneStepError MeasureOneStep(const SimulatorFactory& factory, const Dataset& dataset, int max_rows, int n_threads) {
  OTED_CHECK(factory.spec().can_set_state && max_rows >= 1);
  const auto simulator = factory.Make(kLanes, n_threads);
  const std::vector<double> nominal = factory.parameters().Nominal();
  for (int lane = 0; lane < kLanes; ++lane) simulator->SetParameters(lane, nominal);
  std::vector<int> all, inner;
  for (const Episode& e : dataset.Episodes()) {
    for (int i = e.begin; i < e.end; ++i) {
      all.push_back(i);
      if (i - kLargestShift >= e.begin && i + kLargestShift < e.end) inner.push_back(i);
    }
  }
  OneStepError result = Measure(*simulator, dataset, Spread(all, max_rows), 0);
  if (static_cast<int>(inner.size()) < kFewestShifted) return result;
  inner = Spread(inner, max_rows);
  for (int shift = -kLargestShift; shift <= kLargestShift; ++shift) {
    result.ratio_by_shift[shift] = Measure(*simulator, dataset, inner, shift).median_ratio;
  }
  return result;
}

std::optional<ActionShift> BetterShift(const OneStepError& error, double share) {
  const auto& ratios = error.ratio_by_shift;
  const auto best = std::ranges::min_element(ratios, {}, [](const auto& ratio) { return ratio.second; });
  if (best == ratios.end() || best->first == 0) return std::nullopt;
  const double own = ratios.at(0);
  if (best->second > std::min(1.0, share * own)) return std::nullopt;
  return ActionShift{best->first, best->second, own};
}

TerminalAgreement CompareTerminals(const SimulatorFactory& factory, const Dataset& dataset, int max_rows) {
  const auto simulator = factory.Make(1, 1);
  simulator->SetParameters(0, factory.parameters().Nominal());
  std::vector<int> terminal, other;
  for (int i = 0; i < dataset.size(); ++i) {
    (dataset.terminals[static_cast<size_t>(i)] ? terminal : other).push_back(i);
  }
  TerminalAgreement agreement;
  const auto count = [](int row, int& n, int& first) {
    if (n++ == 0) first = row;
  };
  for (const int row : terminal) {
    const auto ends = simulator->EndsAt(0, dataset.next_observations.row(row));
    if (!ends) continue;
    ++agreement.n_known;
    if (!*ends) count(row, agreement.n_unexplained, agreement.first_unexplained);
  }
  for (const int row : Spread(other, max_rows)) {
    const auto ends = simulator->EndsAt(0, dataset.next_observations.row(row));
    if (!ends) continue;
    ++agreement.n_known;
    if (*ends) count(row, agreement.n_missed, agreement.first_missed);
  }
  return agreement;
}

}  // namespace oted
