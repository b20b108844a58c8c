#include "oted/stages/design/replay/windows.h"

#include <algorithm>

#include "oted/base/error.h"

namespace oted {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr int kReplayLanes = 256;

/// The lanes of one window: the base replay, one per parameter, one per start coordinate.
int LanesPerWindow(int n_parameters, int obs_dim) { return 1 + n_parameters + obs_dim; }

}  // namespace

int WindowReplayer::LinearizationLanes(int n_parameters, int obs_dim) {
  const int per_window = LanesPerWindow(n_parameters, obs_dim);
  return std::max(1, kReplayLanes / per_window) * per_window;
}

WindowReplayer::WindowReplayer(std::unique_ptr<Simulator> simulator, const Dataset& dataset)
    : simulator_(std::move(simulator)),
      dataset_(dataset),
      obs_dim_(simulator_->spec().obs_dim()),
      actions_(static_cast<size_t>(simulator_->n_lanes()) * static_cast<size_t>(simulator_->spec().act_dim)) {
  OTED_CHECK(simulator_->spec().can_set_state && dataset.obs_dim() == obs_dim_);
}

VectorXd WindowReplayer::Logged(const LogWindow& window, int t) const {
  const auto row =
      t == 0 ? dataset_.observations.row(window.begin) : dataset_.next_observations.row(window.begin + t - 1);
  return Eigen::Map<const VectorXd>(row.data(), obs_dim_);
}

bool WindowReplayer::CanStart(const LogWindow& window) {
  return SetLane(0, simulator_->parameters().Nominal(), window, Logged(window, 0));
}

bool WindowReplayer::SetLane(int lane, const std::vector<double>& z, const LogWindow& window, const VectorXd& start) {
  simulator_->SetParameters(lane, z);
  return start.allFinite() && simulator_->SetStateFromLog(lane, {start.data(), static_cast<size_t>(start.size())},
                                                          HistoryBefore(dataset_, window));
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
      residuals[first + k] = VectorXd::Zero((windows[first + k].n_steps + 1) * obs_dim_);
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
        residual.segment(t * obs_dim_, obs_dim_) = Logged(windows[first + static_cast<size_t>(lane)], t) -
                                                   Eigen::Map<const VectorXd>(simulated.data(), obs_dim_);
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
  const int n_parameters = static_cast<int>(perturbed.size()), per_window = LanesPerWindow(n_parameters, obs_dim_);
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
      const int size = (windows[w].n_steps + 1) * obs_dim_;
      linear.residual = VectorXd::Zero(size);
      linear.d_parameters = MatrixXd::Zero(size, n_parameters);
      linear.d_start = MatrixXd::Zero(size, obs_dim_);
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
        const Eigen::Map<const VectorXd> simulated(base.data(), obs_dim_);
        linear.residual.segment(t * obs_dim_, obs_dim_) = Logged(windows[w], t) - simulated;
        for (int p = 0; p < per_window; ++p) {
          const int lane = k * per_window + p;
          linear.valid = linear.valid && simulator_->status(lane) != LaneStatus::kDiverged;
          if (p == 0) continue;
          const auto moved = simulator_->observation(lane);
          const VectorXd change = Eigen::Map<const VectorXd>(moved.data(), obs_dim_) - simulated;
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
