#include "oted/stages/design/replay/windows.h"

#include <algorithm>
#include <atomic>

#include "oted/base/error.h"
#include "oted/base/parallel.h"
#include "oted/matching/as_vector.h"

namespace oted {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr size_t kMostKept = size_t{1} << 22;  // numbers of replays that are kept at a time: 32 MB
constexpr int kPartsEach = 4;                  // that a simulator takes of the replays, so that none waits for long

/// Where a filtered drive is at an episode's start is not known. Short episodes are not given up for that.
int RowsBefore(const SimulatorSpec& spec, const Dataset& dataset) {
  int longest = 0;
  for (const Episode& episode : dataset.Episodes()) longest = std::max(longest, episode.end - episode.begin);
  return std::min(spec.n_rows_before, longest / 4);
}

}  // namespace

WindowReplayer::WindowReplayer(std::unique_ptr<Simulator> simulator, const Dataset& dataset)
    : dataset_(dataset),
      obs_dim_(simulator->spec().obs_dim()),
      n_past_actions_(RowsBefore(simulator->spec(), dataset)),
      readings_(ReadingModel::Plain(obs_dim_)),
      rates_(dataset, simulator->spec().control_period_s) {
  OTED_CHECK(simulator->spec().can_set_state && dataset.obs_dim() == obs_dim_);
  simulators_.push_back(std::move(simulator));
}

WindowReplayer::WindowReplayer(Simulators simulators, const Dataset& dataset, ReadingModel readings)
    : simulators_(std::move(simulators)),
      dataset_(dataset),
      obs_dim_(spec().obs_dim()),
      n_past_actions_(spec().n_past_actions + RowsBefore(spec(), dataset)),
      starts_are_states_(true),
      readings_(std::move(readings)),
      rates_(dataset, spec().control_period_s) {
  OTED_CHECK(spec().can_replay() && dataset.obs_dim() == obs_dim_);
  OTED_CHECK(readings_.state_dim() == spec().state_dim());
}

void WindowReplayer::Expect(int k, double mean, double std) {
  readings_.mean[k] = mean;
  readings_.std[k] = std;
  guesses_.clear();
}

VectorXd WindowReplayer::Guess(const LogWindow& window) const {
  if (readings_.unread.empty()) return Logged(window, 0);
  const auto [known, is_new] = guesses_.try_emplace(window.begin);
  if (is_new) known->second = readings_.Guess(spec(), dataset_, rates_, window.begin);
  return known->second;
}

VectorXd WindowReplayer::Unread(const LogWindow& window, const VectorXd& start) const {
  const VectorXd guess = Guess(window);
  VectorXd left(readings_.n_unread());
  for (int k = 0; k < left.size(); ++k) {
    const int j = readings_.unread[static_cast<size_t>(k)];
    left[k] = guess[j] - start[j];
  }
  return left;
}

VectorXd WindowReplayer::Logged(const LogWindow& window, int t) const {
  const auto row =
      t == 0 ? dataset_.observations.row(window.begin) : dataset_.next_observations.row(window.begin + t - 1);
  return AsVector(row);
}

bool WindowReplayer::CanStart(const LogWindow& window) {
  const std::vector<double> nominal = simulators_.front()->parameters().Nominal();
  return window.begin - window.episode_begin >= n_past_actions_ &&
         SetLane(*simulators_.front(), 0, {&window, &nominal, Guess(window)});
}

bool WindowReplayer::SetLane(Simulator& simulator, int lane, const Replay& replay) const {
  simulator.SetParameters(lane, *replay.z);
  const std::span<const double> state(replay.start.data(), static_cast<size_t>(replay.start.size()));
  const LoggedHistory before = HistoryBefore(dataset_, *replay.window);
  return replay.start.allFinite() && (starts_are_states_ ? simulator.SetState(lane, state, before)
                                                         : simulator.SetStateFromLog(lane, state, before));
}

void WindowReplayer::ReplayIn(Simulator& simulator, std::span<const Replay> replays, std::span<VectorXd> shown) const {
  const auto act_dim = static_cast<size_t>(dataset_.act_dim());
  std::vector<int> running;
  for (size_t k = 0; k < replays.size(); ++k) {
    if (!SetLane(simulator, static_cast<int>(k), replays[k])) continue;
    shown[k].resize((replays[k].window->n_steps + 1) * obs_dim_);
    running.push_back(static_cast<int>(k));
  }
  std::vector<double> actions(static_cast<size_t>(simulator.n_lanes()) * act_dim);
  for (int t = 0; t <= replays.front().window->n_steps && !running.empty(); ++t) {
    if (t > 0) {
      for (const int lane : running) {
        const auto action = dataset_.actions.row(replays[static_cast<size_t>(lane)].window->begin + t - 1);
        std::copy(action.begin(), action.end(), actions.begin() + static_cast<ptrdiff_t>(lane) * dataset_.act_dim());
      }
      simulator.Step(running, actions);
    }
    std::erase_if(running, [&](int lane) {
      VectorXd& of_lane = shown[static_cast<size_t>(lane)];
      if (simulator.status(lane) == LaneStatus::kDiverged) {
        of_lane.resize(0);
        return true;
      }
      const auto observation = simulator.observation(lane);
      of_lane.segment(t * obs_dim_, obs_dim_) = AsVector(observation);
      return false;
    });
  }
}

WindowReplayer::Shown WindowReplayer::ReplayAll(const std::vector<Replay>& replays) const {
  Shown shown(replays.size());
  const auto n_simulators = static_cast<int>(simulators_.size());
  const size_t per_part = (replays.size() + simulators_.size() * kPartsEach - 1) / (simulators_.size() * kPartsEach);
  const size_t n = std::clamp<size_t>(per_part, 1, static_cast<size_t>(simulators_.front()->n_lanes()));
  std::atomic<size_t> next{0};
  ParallelFor(n_simulators, n_simulators, [&](int k) {
    for (size_t first = n * next++; first < replays.size(); first = n * next++) {
      const size_t size = std::min(n, replays.size() - first);
      ReplayIn(*simulators_[static_cast<size_t>(k)], std::span(replays).subspan(first, size),
               std::span(shown).subspan(first, size));
    }
  });
  return shown;
}

size_t WindowReplayer::AtOnce(const LogWindow& window, int per_window) const {
  return std::max<size_t>(1, kMostKept / static_cast<size_t>((window.n_steps + 1) * obs_dim_ * per_window));
}

VectorXd WindowReplayer::LoggedMinus(const LogWindow& window, const VectorXd& start, const VectorXd& shown) const {
  const int n_unread = readings_.n_unread();
  VectorXd residual(shown.size() + n_unread);
  for (int t = 0; t <= window.n_steps; ++t) {
    residual.segment(t * obs_dim_, obs_dim_) = Logged(window, t) - shown.segment(t * obs_dim_, obs_dim_);
  }
  if (n_unread > 0) residual.tail(n_unread) = Unread(window, start);
  return residual;
}

std::vector<VectorXd> WindowReplayer::Residuals(const std::vector<LogWindow>& windows,
                                                const std::vector<VectorXd>& starts, const std::vector<double>& z) {
  std::vector<VectorXd> residuals(windows.size());
  if (windows.empty()) return residuals;
  const size_t at_once = AtOnce(windows.front(), 1);
  for (size_t first = 0; first < windows.size(); first += at_once) {
    const size_t end = std::min(windows.size(), first + at_once);
    std::vector<Replay> replays;
    for (size_t w = first; w < end; ++w) replays.push_back({&windows[w], &z, starts[w]});
    const Shown shown = ReplayAll(replays);
    for (size_t w = first; w < end; ++w) {
      if (shown[w - first].size() > 0) residuals[w] = LoggedMinus(windows[w], starts[w], shown[w - first]);
    }
  }
  return residuals;
}

std::vector<WindowReplayer::Linearization> WindowReplayer::Linearize(const std::vector<LogWindow>& windows,
                                                                     const std::vector<VectorXd>& starts,
                                                                     const std::vector<double>& z,
                                                                     const std::vector<std::vector<double>>& perturbed,
                                                                     const VectorXd& steps,
                                                                     const std::vector<VectorXd>& start_steps) {
  std::vector<Linearization> result(windows.size());
  if (windows.empty()) return result;
  const int n_moved = start_steps.empty() ? 0 : state_dim();
  // Of one window: the base replay, one per parameter, one per start coordinate that is moved.
  const size_t per_window = 1 + perturbed.size() + static_cast<size_t>(n_moved);
  const size_t at_once = AtOnce(windows.front(), static_cast<int>(per_window));
  for (size_t first = 0; first < windows.size(); first += at_once) {
    const size_t end = std::min(windows.size(), first + at_once);
    std::vector<Replay> replays;
    for (size_t w = first; w < end; ++w) {
      replays.push_back({&windows[w], &z, starts[w]});
      for (const std::vector<double>& moved : perturbed) replays.push_back({&windows[w], &moved, starts[w]});
      for (int j = 0; j < n_moved; ++j) {
        replays.push_back({&windows[w], &z, starts[w]});
        replays.back().start[j] += start_steps[w][j];
      }
    }
    const Shown shown = ReplayAll(replays);
    for (size_t w = first; w < end; ++w) {
      const std::span<const VectorXd> of_window = std::span(shown).subspan((w - first) * per_window, per_window);
      if (std::ranges::any_of(of_window, [](const VectorXd& one) { return one.size() == 0; })) continue;
      Linearization& linear = result[w];
      linear.valid = true;
      linear.residual = LoggedMinus(windows[w], starts[w], of_window.front());
      const auto size = linear.residual.size(), n_shown = of_window.front().size();
      const int n_parameters = static_cast<int>(perturbed.size());
      linear.d_parameters = MatrixXd::Zero(size, n_parameters);
      linear.d_start = MatrixXd::Zero(size, n_moved);
      const auto change = [&](int p) { return of_window[static_cast<size_t>(1 + p)] - of_window.front(); };
      for (int p = 0; p < n_parameters; ++p) linear.d_parameters.col(p).head(n_shown) = change(p) / steps[p];
      for (int j = 0; j < n_moved; ++j) {
        linear.d_start.col(j).head(n_shown) = change(n_parameters + j) / start_steps[w][j];
      }
      for (int i = 0; i < readings_.n_unread() && n_moved > 0; ++i) {
        linear.d_start(n_shown + i, readings_.unread[static_cast<size_t>(i)]) = 1;
      }
    }
  }
  return result;
}

}  // namespace oted
