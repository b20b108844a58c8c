#include "oted/stages/design/replay/windows.h"

#include <algorithm>

#include "oted/base/error.h"
#include "oted/matching/as_vector.h"

namespace oted {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int kReplayLanes = 256;

/// The lanes of one window: the base replay, one per parameter, one per start coordinate that is moved.
int LanesPerWindow(int n_parameters, int n_moved) { return 1 + n_parameters + n_moved; }

/// Where a filtered drive is at an episode's start is not known. Short episodes are not given up for that.
int RowsBefore(const SimulatorSpec& spec, const Dataset& dataset) {
  int longest = 0;
  for (const Episode& episode : dataset.Episodes()) longest = std::max(longest, episode.end - episode.begin);
  return std::min(spec.n_rows_before, longest / 4);
}

}  // namespace

int WindowReplayer::LinearizationLanes(int n_parameters, int state_dim) {
  const int per_window = LanesPerWindow(n_parameters, state_dim);
  return std::max(1, kReplayLanes / per_window) * per_window;
}

WindowReplayer::WindowReplayer(std::unique_ptr<Simulator> simulator, const Dataset& dataset)
    : simulator_(std::move(simulator)),
      dataset_(dataset),
      obs_dim_(simulator_->spec().obs_dim()),
      n_past_actions_(RowsBefore(simulator_->spec(), dataset)),
      readings_(ReadingModel::Plain(obs_dim_)),
      rates_(dataset, simulator_->spec().control_period_s),
      actions_(static_cast<size_t>(simulator_->n_lanes()) * static_cast<size_t>(simulator_->spec().act_dim)) {
  OTED_CHECK(simulator_->spec().can_set_state && dataset.obs_dim() == obs_dim_);
}

WindowReplayer::WindowReplayer(std::unique_ptr<Simulator> simulator, const Dataset& dataset, ReadingModel readings)
    : simulator_(std::move(simulator)),
      dataset_(dataset),
      obs_dim_(simulator_->spec().obs_dim()),
      n_past_actions_(simulator_->spec().n_past_actions + RowsBefore(simulator_->spec(), dataset)),
      starts_are_states_(true),
      readings_(std::move(readings)),
      rates_(dataset, simulator_->spec().control_period_s),
      actions_(static_cast<size_t>(simulator_->n_lanes()) * static_cast<size_t>(simulator_->spec().act_dim)) {
  OTED_CHECK(simulator_->spec().can_replay() && dataset.obs_dim() == obs_dim_);
  OTED_CHECK(readings_.state_dim() == simulator_->spec().state_dim());
}

void WindowReplayer::Expect(int k, double mean, double std) {
  readings_.mean[k] = mean;
  readings_.std[k] = std;
  guesses_.clear();
}

VectorXd WindowReplayer::Guess(const LogWindow& window) const {
  if (readings_.unread.empty()) return Logged(window, 0);
  const auto [known, is_new] = guesses_.try_emplace(window.begin);
  if (is_new) known->second = readings_.Guess(simulator_->spec(), dataset_, rates_, window.begin);
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
  return window.begin - window.episode_begin >= n_past_actions_ &&
         SetLane(0, simulator_->parameters().Nominal(), window, Guess(window));
}

bool WindowReplayer::SetLane(int lane, const std::vector<double>& z, const LogWindow& window, const VectorXd& start) {
  simulator_->SetParameters(lane, z);
  const std::span<const double> state(start.data(), static_cast<size_t>(start.size()));
  const LoggedHistory before = HistoryBefore(dataset_, window);
  return start.allFinite() && (starts_are_states_ ? simulator_->SetState(lane, state, before)
                                                  : simulator_->SetStateFromLog(lane, state, before));
}

void WindowReplayer::StepLanes(const std::vector<int>& lanes, const std::vector<int>& rows) {
  const size_t act_dim = static_cast<size_t>(dataset_.act_dim());
  std::vector<int> running;
  for (size_t i = 0; i < lanes.size(); ++i) {
    if (simulator_->status(lanes[i]) == LaneStatus::kDiverged) continue;
    running.push_back(lanes[i]);
    const auto action = dataset_.actions.row(rows[i]);
    std::copy(action.begin(), action.end(), actions_.begin() + static_cast<ptrdiff_t>(lanes[i]) * act_dim);
  }
  simulator_->Step(running, actions_);
}

std::vector<VectorXd> WindowReplayer::Residuals(const std::vector<LogWindow>& windows,
                                                const std::vector<VectorXd>& starts, const std::vector<double>& z) {
  std::vector<VectorXd> residuals(windows.size());
  const size_t n_lanes = static_cast<size_t>(simulator_->n_lanes());
  for (size_t first = 0; first < windows.size(); first += n_lanes) {
    const size_t n = std::min(n_lanes, windows.size() - first);
    std::vector<int> lanes, rows;
    for (size_t k = 0; k < n; ++k) {
      if (!SetLane(static_cast<int>(k), z, windows[first + k], starts[first + k])) continue;
      const int n_readings = (windows[first + k].n_steps + 1) * obs_dim_;
      residuals[first + k] = VectorXd::Zero(n_readings + readings_.n_unread());
      if (readings_.n_unread() > 0) {
        residuals[first + k].tail(readings_.n_unread()) = Unread(windows[first + k], starts[first + k]);
      }
      lanes.push_back(static_cast<int>(k));
      rows.push_back(windows[first + k].begin);
    }
    for (int t = 0; t <= windows[first].n_steps; ++t) {
      if (t > 0) {
        StepLanes(lanes, rows);
        for (int& row : rows) ++row;
      }
      for (const int lane : lanes) {
        VectorXd& residual = residuals[first + static_cast<size_t>(lane)];
        if (simulator_->status(lane) == LaneStatus::kDiverged) residual.resize(0);
        if (residual.size() == 0) continue;
        const auto simulated = simulator_->observation(lane);
        residual.segment(t * obs_dim_, obs_dim_) =
            Logged(windows[first + static_cast<size_t>(lane)], t) - AsVector(simulated);
      }
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
  const int n_parameters = static_cast<int>(perturbed.size()), n_moved = start_steps.empty() ? 0 : state_dim();
  const int per_window = LanesPerWindow(n_parameters, n_moved);
  const int at_once = simulator_->n_lanes() / per_window;
  OTED_CHECK(at_once >= 1);
  std::vector<Linearization> result(windows.size());
  for (size_t first = 0; first < windows.size(); first += static_cast<size_t>(at_once)) {
    const int n = static_cast<int>(std::min<size_t>(static_cast<size_t>(at_once), windows.size() - first));
    std::vector<int> lanes, rows;
    for (int k = 0; k < n; ++k) {
      const size_t w = first + static_cast<size_t>(k);
      Linearization& linear = result[w];
      linear.valid = true;
      for (int p = 0; p < per_window; ++p) {
        VectorXd start = starts[w];
        if (p > n_parameters) start[p - 1 - n_parameters] += start_steps[w][p - 1 - n_parameters];
        const bool moves_parameter = p > 0 && p <= n_parameters;
        linear.valid = SetLane(k * per_window + p, moves_parameter ? perturbed[static_cast<size_t>(p - 1)] : z,
                               windows[w], start) &&
                       linear.valid;
      }
      if (!linear.valid) continue;
      const int n_unread = readings_.n_unread(), size = (windows[w].n_steps + 1) * obs_dim_ + n_unread;
      linear.residual = VectorXd::Zero(size);
      linear.d_parameters = MatrixXd::Zero(size, n_parameters);
      linear.d_start = MatrixXd::Zero(size, n_moved);
      if (n_unread > 0) linear.residual.tail(n_unread) = Unread(windows[w], starts[w]);
      for (int i = 0; i < n_unread && n_moved > 0; ++i) {
        linear.d_start(size - n_unread + i, readings_.unread[static_cast<size_t>(i)]) = 1;
      }
      for (int p = 0; p < per_window; ++p) {
        lanes.push_back(k * per_window + p);
        rows.push_back(windows[w].begin);
      }
    }
    for (int t = 0; t <= windows[first].n_steps; ++t) {
      if (t > 0) {
        StepLanes(lanes, rows);
        for (int& row : rows) ++row;
      }
      for (int k = 0; k < n; ++k) {
        const size_t w = first + static_cast<size_t>(k);
        Linearization& linear = result[w];
        if (!linear.valid) continue;
        const auto base = simulator_->observation(k * per_window);
        const auto simulated = AsVector(base);
        linear.residual.segment(t * obs_dim_, obs_dim_) = Logged(windows[w], t) - simulated;
        for (int p = 0; p < per_window; ++p) {
          const int lane = k * per_window + p;
          linear.valid = linear.valid && simulator_->status(lane) != LaneStatus::kDiverged;
          if (p == 0) continue;
          const auto moved = simulator_->observation(lane);
          const VectorXd change = AsVector(moved) - simulated;
          if (p <= n_parameters) {
            linear.d_parameters.block(t * obs_dim_, p - 1, obs_dim_, 1) = change / steps[p - 1];
          } else {
            const int j = p - 1 - n_parameters;
            linear.d_start.block(t * obs_dim_, j, obs_dim_, 1) = change / start_steps[w][j];
          }
        }
      }
    }
  }
  return result;
}

}  // namespace oted
