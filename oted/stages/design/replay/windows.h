#pragma once
/// Windows of the log, replayed: the logged actions from a start state of the caller's choice. Trajectory matching
/// compares the simulator's observations with the logged ones, step by step.

#include <Eigen/Dense>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/log_window.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/replay/local_rates.h"
#include "oted/stages/design/replay/reading_model.h"

namespace oted {

/// Replays windows in simulators whose state can be set. Not thread-safe; each simulator has a thread of its own, which
/// takes whole windows: threads that meet at every control step would wait for one another most of the time.
class WindowReplayer {
 public:
  using Simulators = std::vector<std::unique_ptr<Simulator>>;
  /// Starts are readings as they were logged (Simulator::SetStateFromLog). @param dataset must outlive this object.
  WindowReplayer(std::unique_ptr<Simulator> simulator, const Dataset& dataset);
  /// Starts are states that a fit finds (Simulator::SetState). Residuals go on with those of the unread coordinates,
  /// guess minus start. @param simulators  alike, at least one
  WindowReplayer(Simulators simulators, const Dataset& dataset, ReadingModel readings);

  int obs_dim() const { return obs_dim_; }
  int state_dim() const { return readings_.state_dim(); }
  const ReadingModel& readings() const { return readings_; }
  const Dataset& dataset() const { return dataset_; }
  /// The guess for coordinates that the logs suggest nothing of, and its standard deviation, from a fit.
  /// @param k  into readings().unread
  void Expect(int k, double mean, double std);
  /// How often the actions before a window matter: windows that begin sooner in an episode cannot be replayed.
  int n_past_actions() const { return n_past_actions_; }
  /// Where the fit of a window's start begins: its reading, guesses for what that does not show.
  Eigen::VectorXd Guess(const LogWindow& window) const;
  /// The logged observation t steps into a window.
  Eigen::VectorXd Logged(const LogWindow& window, int t) const;
  /// Can the simulator be set to the logged first state of the window, and are the actions known that still act there?
  bool CanStart(const LogWindow& window);

  /// Logged minus simulated observations, (n_steps + 1, obs_dim) row by row, then n_unread numbers; empty where the
  /// start cannot be set or the physics broke down. All windows have the same number of steps.
  std::vector<Eigen::VectorXd> Residuals(const std::vector<LogWindow>& windows,
                                         const std::vector<Eigen::VectorXd>& starts, const std::vector<double>& z);

  /// The simulated observations of one window, to first order in its start and in the parameters' search coordinates.
  struct Linearization {
    bool valid = false;            ///< false as Residuals is empty, also for a perturbed replay
    Eigen::VectorXd residual;      ///< (n), as Residuals
    Eigen::MatrixXd d_start;       ///< (n, state_dim or 0): of what was subtracted there
    Eigen::MatrixXd d_parameters;  ///< (n, parameters)
  };
  /// By forward differences.
  /// @param perturbed    z with one search coordinate moved by its step, one per parameter
  /// @param steps        (parameters): the steps
  /// @param start_steps  of each window, (state_dim): how far each start coordinate is moved; empty where starts are
  ///                     known, and d_start has no columns
  std::vector<Linearization> Linearize(const std::vector<LogWindow>& windows,
                                       const std::vector<Eigen::VectorXd>& starts, const std::vector<double>& z,
                                       const std::vector<std::vector<double>>& perturbed, const Eigen::VectorXd& steps,
                                       const std::vector<Eigen::VectorXd>& start_steps);

 private:
  /// What one lane is to replay.
  struct Replay {
    const LogWindow* window;
    const std::vector<double>* z;
    Eigen::VectorXd start;
  };
  /// Observations that a replay showed, (n_steps + 1, obs_dim) row by row; empty as Residuals is.
  using Shown = std::vector<Eigen::VectorXd>;

  bool SetLane(Simulator& simulator, int lane, const Replay& replay) const;
  /// @param replays  at most as many as the simulator has lanes, of the same number of steps
  void ReplayIn(Simulator& simulator, std::span<const Replay> replays, std::span<Eigen::VectorXd> shown) const;
  /// On all simulators.
  Shown ReplayAll(const std::vector<Replay>& replays) const;

  /// How many windows of `per_window` replays are kept at a time.
  size_t AtOnce(const LogWindow& window, int per_window) const;
  /// A residual, of what a replay showed.
  Eigen::VectorXd LoggedMinus(const LogWindow& window, const Eigen::VectorXd& start,
                              const Eigen::VectorXd& shown) const;
  /// The residuals of the unread coordinates.
  Eigen::VectorXd Unread(const LogWindow& window, const Eigen::VectorXd& start) const;

  const SimulatorSpec& spec() const { return simulators_.front()->spec(); }

  Simulators simulators_;
  const Dataset& dataset_;
  int obs_dim_;
  int n_past_actions_ = 0;
  bool starts_are_states_ = false;
  ReadingModel readings_;
  mutable LocalRates rates_;
  mutable std::map<int, Eigen::VectorXd> guesses_;  // by row: asked for often
};

}  // namespace oted
