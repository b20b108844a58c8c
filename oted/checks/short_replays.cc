#include "oted/checks/short_replays.h"

#include <algorithm>
#include <cmath>

#include "oted/stages/design/replay/reading_model.h"

namespace oted {
namespace {

constexpr size_t kWindows = 300;
constexpr int kLanes = 50;
constexpr double kWindow_s = 0.05;
constexpr double kUnreadWindow_s = 0.25;  // where rates are guessed: a force has to outdo their errors
constexpr int kLongestWindow = 10;        // rows; five times as many where rates are guessed
constexpr double kCap = 2;                // an error counts as so many times the usual change at most

/// The states in which windows from these rows on begin.
Array2<double> StatesAt(const SimulatorSpec& spec, const Dataset& dataset, const std::vector<int>& rows) {
  const ReadingModel readings = ReadingModel::Of(spec, dataset);
  LocalRates rates(dataset, spec.control_period_s);
  Array2<double> states;
  for (const int row : rows) {
    const Eigen::VectorXd state = readings.Guess(spec, dataset, rates, row);
    states.AppendRow({state.data(), static_cast<size_t>(state.size())});
  }
  return states;
}

}  // namespace

double MeanOf(const ChannelErrors& errors, const std::vector<int>& channels) {
  double sum = 0;
  for (const int j : channels) sum += errors[static_cast<size_t>(j)];
  return channels.empty() ? 0 : sum / static_cast<double>(channels.size());
}

ShortReplays::ShortReplays(const SimulatorFactory& factory, int n_threads)
    : spec_(factory.spec()), simulator_(factory.Make(kLanes, n_threads)) {
  SetParameters(factory.parameters().Nominal());
  if (!(spec_.control_period_s > 0)) return;
  const double seconds = spec_.can_set_state ? kWindow_s : kUnreadWindow_s;
  n_steps_ = std::clamp(static_cast<int>(std::lround(seconds / spec_.control_period_s)), 1,
                        spec_.can_set_state ? kLongestWindow : 5 * kLongestWindow);
}

void ShortReplays::SetParameters(const std::vector<double>& z) {
  for (int lane = 0; lane < kLanes; ++lane) simulator_->SetParameters(lane, z);
}

ReplayedWindows ShortReplays::Choose(const Dataset& dataset) const {
  int before = spec_.n_past_actions + spec_.n_rows_before;
  for (const int age : spec_.reading_ages) before = std::max(before, age);
  std::vector<int> all;
  for (const Episode& e : dataset.Episodes()) {
    for (int i = e.begin; i + n_steps_ <= e.end; ++i) all.push_back(i);
  }
  const size_t every = std::max<size_t>(1, all.size() / kWindows);
  std::vector<Episode> pieces;
  std::vector<int> rows;
  ReplayedWindows chosen;
  int at = 0;
  for (size_t k = every / 2; k < all.size(); k += every) {
    const int history = std::min(before, all[k] - WindowAt(dataset, all[k], n_steps_).episode_begin);
    pieces.push_back({all[k] - history, all[k] + n_steps_, false});
    chosen.windows.push_back({at + history, n_steps_, at});
    rows.push_back(all[k]);
    at += history + n_steps_;
  }
  if (pieces.empty()) return chosen;
  chosen.log = dataset.Select(pieces);
  if (!spec_.can_set_state) chosen.states = StatesAt(spec_, dataset, rows);
  return chosen;
}

bool ShortReplays::SetLane(int lane, const ReplayedWindows& windows, size_t window) {
  const LogWindow& at = windows.windows[window];
  const LoggedHistory before = HistoryBefore(windows.log, at);
  return windows.states.empty() ? simulator_->SetStateFromLog(lane, windows.log.observations.row(at.begin), before)
                                : simulator_->SetState(lane, windows.states.row(static_cast<int>(window)), before);
}

std::optional<ChannelErrors> ShortReplays::Errors(const ReplayedWindows& windows, size_t stride) {
  const size_t d = static_cast<size_t>(spec_.obs_dim()), a = static_cast<size_t>(spec_.act_dim);
  const Dataset& log = windows.log;
  const auto last = [&](const LogWindow& w, size_t j) {
    return log.next_observations(w.begin + n_steps_ - 1, static_cast<int>(j));
  };
  ChannelErrors change(d, 0.0), sum(d, 0.0);
  std::vector<size_t> which;
  for (size_t k = 0; k < windows.windows.size(); k += stride) which.push_back(k);
  for (const size_t k : which) {
    const LogWindow& w = windows.windows[k];
    for (size_t j = 0; j < d; ++j) {
      change[j] += std::pow(last(w, j) - log.observations(w.begin, static_cast<int>(j)), 2);
    }
  }
  int n = 0;
  std::vector<double> actions(static_cast<size_t>(kLanes) * a);
  for (size_t first = 0; first < which.size(); first += kLanes) {
    std::vector<int> lanes;
    std::vector<LogWindow> set;
    for (size_t k = first; k < std::min(which.size(), first + kLanes); ++k) {
      const int lane = static_cast<int>(lanes.size());
      if (!SetLane(lane, windows, which[k])) continue;
      lanes.push_back(lane);
      set.push_back(windows.windows[which[k]]);
    }
    std::vector<int> running = lanes;
    for (int t = 0; t < n_steps_; ++t) {
      for (const int lane : running) {
        const auto action = log.actions.row(set[static_cast<size_t>(lane)].begin + t);
        std::copy(action.begin(), action.end(),
                  actions.begin() + static_cast<std::ptrdiff_t>(static_cast<size_t>(lane) * a));
      }
      simulator_->Step(running, actions);
      std::erase_if(running, [&](int lane) { return simulator_->status(lane) == LaneStatus::kDiverged; });
    }
    for (const int lane : lanes) {
      const bool diverged = simulator_->status(lane) == LaneStatus::kDiverged;
      for (size_t j = 0; j < d; ++j) {
        if (change[j] <= 0) continue;
        const double squared = std::pow(simulator_->observation(lane)[j] - last(set[static_cast<size_t>(lane)], j), 2) *
                               static_cast<double>(which.size()) / change[j];
        sum[j] += diverged ? kCap * kCap : std::min(squared, kCap * kCap);
      }
      ++n;
    }
  }
  if (n < kFewestShortWindows / static_cast<int>(stride)) return std::nullopt;
  for (double& s : sum) s /= n;
  return sum;
}

}  // namespace oted
