#include "oted/sim/replay.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "oted/base/error.h"
#include "oted/sim/log_window.h"

namespace oted {
namespace {

/// Puts a lane into a start, with what was logged before it: what a delay has yet to deliver.
bool SetTo(Simulator& simulator, int lane, const Dataset& dataset, const ReplayStart& start) {
  const LoggedHistory before = HistoryBefore(dataset, WindowAt(dataset, start.row, 1));
  if (!start.state.empty()) return simulator.SetState(lane, start.state, before);
  return simulator.SetStateFromLog(lane, dataset.observations.row(start.row), before);
}

bool CanStart(Simulator& simulator, const Dataset& dataset, int row) {
  const SimulatorSpec& spec = simulator.spec();
  if (spec.can_set_state) return SetTo(simulator, 0, dataset, {row, {}});
  if (row - WindowAt(dataset, row, 1).episode_begin < spec.n_past_actions) return false;
  const auto logged = dataset.observations.row(row);
  ReplayStart start{row, {logged.begin(), logged.end()}};
  start.state.resize(static_cast<size_t>(spec.state_dim()));
  return SetTo(simulator, 0, dataset, start);
}

}  // namespace

std::vector<int> ReplayStarts(Simulator& simulator, const Dataset& dataset, int n_steps, int n_windows) {
  if (!simulator.spec().can_replay()) {
    throw UsageError(
        fmt::format("task '{}' has no settable state: its logs cannot be replayed", simulator.spec().task));
  }
  // Rows with n_steps rows behind them in the same episode, one episode after the other.
  std::vector<int> rows;
  for (const Episode& episode : dataset.Episodes()) {
    for (int row = episode.begin; row + n_steps <= episode.end; ++row) rows.push_back(row);
  }
  std::vector<int> starts;
  const size_t wanted = std::min(rows.size(), static_cast<size_t>(n_windows));
  size_t next = 0;  // no row twice
  for (size_t i = 0; i < wanted; ++i) {
    const size_t end = rows.size() * (i + 1) / wanted;
    for (next = std::max(next, rows.size() * i / wanted); next < end; ++next) {
      if (!CanStart(simulator, dataset, rows[next])) continue;
      starts.push_back(rows[next++]);
      break;
    }
  }
  return starts;
}

Array2<double> LoggedWindow(const Dataset& dataset, int begin, int n_steps) {
  Array2<double> window(n_steps + 1, dataset.obs_dim());
  for (int t = 0; t <= n_steps; ++t) {
    const auto row =
        t < n_steps ? dataset.observations.row(begin + t) : dataset.next_observations.row(begin + n_steps - 1);
    std::copy(row.begin(), row.end(), window.row(t).begin());
  }
  return window;
}

std::vector<ReplayStart> AsLogged(std::span<const int> rows) {
  std::vector<ReplayStart> starts;
  for (const int row : rows) starts.push_back({row, {}});
  return starts;
}

std::vector<Array2<double>> ReplayWindows(Simulator& simulator, const Dataset& dataset,
                                          std::span<const ReplayStart> starts, int n_steps, std::span<const double> z,
                                          const std::function<void(int t)>& seen) {
  const int n_lanes = simulator.n_lanes();
  OTED_CHECK(static_cast<int>(starts.size()) == n_lanes);
  std::vector<Array2<double>> windows(starts.size(), Array2<double>(n_steps + 1, dataset.obs_dim()));
  std::vector<bool> started(starts.size());
  const auto is_valid = [&](int lane) {
    return started[static_cast<size_t>(lane)] && simulator.status(lane) != LaneStatus::kDiverged;
  };
  const auto record = [&](int t) {
    for (int lane = 0; lane < n_lanes; ++lane) {
      const auto out = windows[static_cast<size_t>(lane)].row(t);
      if (!is_valid(lane)) {
        std::fill(out.begin(), out.end(), std::numeric_limits<double>::quiet_NaN());
      } else {
        std::copy_n(simulator.observation(lane).begin(), out.size(), out.begin());
      }
    }
    if (seen) seen(t);
  };
  for (int lane = 0; lane < n_lanes; ++lane) {
    simulator.SetParameters(lane, z);
    // What determines a state at one z may not at another: such a window is as good as diverged.
    started[static_cast<size_t>(lane)] = SetTo(simulator, lane, dataset, starts[static_cast<size_t>(lane)]);
  }
  record(0);
  Array2<double> actions(n_lanes, dataset.act_dim());
  std::vector<int> running;
  for (int t = 0; t < n_steps; ++t) {
    running.clear();
    for (int lane = 0; lane < n_lanes; ++lane) {
      const auto row = dataset.actions.row(starts[static_cast<size_t>(lane)].row + t);
      std::copy(row.begin(), row.end(), actions.row(lane).begin());
      if (is_valid(lane)) running.push_back(lane);
    }
    if (!running.empty()) simulator.Step(running, {actions.data(), static_cast<size_t>(n_lanes * dataset.act_dim())});
    record(t + 1);
  }
  return windows;
}

std::vector<double> ChannelSpreads(const Dataset& dataset) {
  std::vector<double> spreads;
  const double n = dataset.size();
  for (int c = 0; c < dataset.obs_dim(); ++c) {
    double mean = 0, square = 0;
    for (int i = 0; i < dataset.size(); ++i) mean += dataset.observations(i, c) / n;
    for (int i = 0; i < dataset.size(); ++i) square += std::pow(dataset.observations(i, c) - mean, 2) / n;
    // A channel that stands still has what rounding leaves of its mean.
    spreads.push_back(std::sqrt(square) > 1e-9 * std::abs(mean) ? std::sqrt(square) : 0);
  }
  return spreads;
}

std::vector<double> ReplayError(const Array2<double>& logged, const Array2<double>& replayed,
                                std::span<const double> spreads) {
  OTED_CHECK(logged.rows() == replayed.rows() && logged.cols() == replayed.cols());
  std::vector<double> errors;
  for (int t = 0; t < logged.rows(); ++t) {
    double sum = 0;
    int n = 0;
    for (int c = 0; c < logged.cols(); ++c) {
      if (spreads[static_cast<size_t>(c)] <= 0) continue;
      sum += std::pow((replayed(t, c) - logged(t, c)) / spreads[static_cast<size_t>(c)], 2);
      ++n;
    }
    const double error = n > 0 ? std::sqrt(sum / n) : 0;
    errors.push_back(std::isfinite(error) ? error : std::numeric_limits<double>::infinity());
  }
  return errors;
}

}  // namespace oted
