#pragma once
/// Windows of the log, replayed: the logged actions from a start state of the caller's choice. Trajectory matching
/// compares the simulator's observations with the logged ones, step by step.

#include <Eigen/Dense>
#include <memory>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/log_window.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Replays windows in a simulator whose state can be set. Not thread-safe; the simulator uses its own threads.
class WindowReplayer {
 public:
  /// @param dataset must outlive this object.
  WindowReplayer(std::unique_ptr<Simulator> simulator, const Dataset& dataset);

  /// How many lanes to give a simulator whose windows are linearized: whole windows, some 256 lanes together.
  static int LinearizationLanes(int n_parameters, int obs_dim);

  int obs_dim() const { return obs_dim_; }
  /// The logged observation t steps into a window.
  Eigen::VectorXd Logged(const LogWindow& window, int t) const;
  /// Can the simulator be set to the logged first state of the window?
  bool CanStart(const LogWindow& window);

  /// Logged minus simulated observations, (n_steps + 1, obs_dim) row by row; empty where the start cannot be set or the
  /// physics broke down. All windows have the same number of steps.
  std::vector<Eigen::VectorXd> Residuals(const std::vector<LogWindow>& windows,
                                         const std::vector<Eigen::VectorXd>& starts, const std::vector<double>& z);

  /// The simulated observations of one window, to first order in its start and in the parameters' search coordinates.
  struct Linearization {
    bool valid = false;            ///< false as Residuals is empty, also for a perturbed replay
    Eigen::VectorXd residual;      ///< ((n_steps + 1) obs_dim), as Residuals
    Eigen::MatrixXd d_start;       ///< ((n_steps + 1) obs_dim, obs_dim) of the simulated observations
    Eigen::MatrixXd d_parameters;  ///< ((n_steps + 1) obs_dim, parameters)
  };
  /// By forward differences.
  /// @param perturbed    z with one search coordinate moved by its step, one per parameter
  /// @param steps        (parameters): the steps
  /// @param start_steps  of each window, (obs_dim): how far each start coordinate is moved
  std::vector<Linearization> Linearize(const std::vector<LogWindow>& windows,
                                       const std::vector<Eigen::VectorXd>& starts, const std::vector<double>& z,
                                       const std::vector<std::vector<double>>& perturbed, const Eigen::VectorXd& steps,
                                       const std::vector<Eigen::VectorXd>& start_steps);

 private:
  bool SetLane(int lane, const std::vector<double>& z, const LogWindow& window, const Eigen::VectorXd& start);
  void StepLanes(const std::vector<int>& lanes, const std::vector<int>& rows);

  std::unique_ptr<Simulator> simulator_;
  const Dataset& dataset_;
  int obs_dim_;
  std::vector<double> actions_;  // (n_lanes, act_dim)
};

}  // namespace oted
