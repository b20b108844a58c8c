#pragma once
/// The first part of trajectory matching: windows of 2, 4, 8, ... control steps, while the longer ones are explained as
/// well as the short ones.

#include <Eigen/Dense>
#include <map>
#include <memory>
#include <vector>

#include "oted/base/rng.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/first_level.h"
#include "oted/stages/design/trajectories/fit_steps.h"
#include "oted/stages/design/trajectories/level_fit.h"
#include "oted/stages/design/trajectories/trajectories_config.h"

namespace oted {

class ShortWindows {
 public:
  /// What it is given must outlive it.
  /// @param n_steps_behind  steps that others take behind these, at most: for the progress that is told
  /// @param evidence        filled in: the windows' length, the share that is explained, the noise
  /// @param computed        readings that are left out from the beginning, as ReadingModel has them
  ShortWindows(const ReplayProblem& problem, const TrajectoriesConfig& config, int n_steps_behind, FitSteps& steps,
               FitEvidence& evidence, const std::vector<char>& computed = {});

  /// @return whether windows of all lengths are explained
  bool Fit() { return FitLengths(FindStart(), false); }
  /// Noise averages out over rows: once x is near, as many as a budget allows. Where they do not explain windows as
  /// long as before, those that they do explain take their place.
  /// @return whether windows as long as before are explained
  bool FitMoreRows();

  /// The longest windows that are explained, fitted.
  LevelFit& fit() { return *fit_; }
  WindowReplayer& replayer() { return *replayer_; }
  const ReadingModel& readings() const { return replayer_->readings(); }
  int shortest() const { return shortest_; }  ///< control steps
  /// Whether the logs are exact but for rounding: their readings are the states.
  bool is_exact() const { return is_exact_; }
  /// Whether more than rounding is left by the longest windows that are explained: shorter ones find starts less well.
  bool IsNoisy() const;
  /// (obs_dim): what the shortest windows leave.
  Eigen::VectorXd SensorNoise() const;

 private:
  /// Makes the replayer and the shortest windows. @param computed  as ReadingModel has it
  void Read(const std::vector<char>& computed);
  /// Of the levels from windows of `length` on, at most.
  int StepsOfLevels(int length) const;
  void Descend(LevelFit& fit, int n_iterations);
  /// Of the prior's draws that explain single steps best, and the nominal parameters, the one that descends farthest.
  Eigen::VectorXd FindStart();
  /// Longer and longer windows.
  /// @param again  x is near already
  /// @return whether all were explained
  bool FitLengths(Eigen::VectorXd x, bool again);
  /// Fits those that are caught in a local minimum from other starts.
  void TryOtherStarts(LevelFit& fit);
  /// Fits again from where something stands elsewhere, or saturates, where windows ask for that, and keeps the better.
  /// Afterwards FinalCost is behind.
  void MoveDistant(std::unique_ptr<LevelFit>& fit);
  /// How many times the noise of the shortest windows these longer ones leave in logs that the simulator of the fit
  /// made itself, with the sensors' noise. Where that is more than once, as through contact, starts are hard to find,
  /// and as much in the logs does not speak against the simulator.
  double GrowthInOwnLogs(const Level& longer);
  /// The same of windows of any logs, each of a stretch of its own, which grow from their shortest pieces.
  double GrowthOf(const Level& windows, WindowReplayer& replayer);
  /// Whether there are readings that were computed from others, or that are of an earlier time than they say; they are
  /// left out from here on.
  bool LeaveOutComputed();
  /// What no log suggests of a start is expected to be as in the windows that were fitted.
  void ExpectUnguessed(const LevelFit& fit);
  bool IsRounding(const Eigen::VectorXd& noise) const;

  const ReplayProblem& problem_;
  const TrajectoriesConfig& config_;
  const ParameterSpace& space_;
  int n_steps_behind_;
  FitSteps& steps_;
  FitEvidence& evidence_;
  Eigen::VectorXd scale_;
  Rng rng_;
  std::unique_ptr<WindowReplayer> replayer_;
  bool is_exact_ = false;
  int shortest_ = 0, longest_ = 0;  // control steps of the windows that are joined
  Level first_;
  std::unique_ptr<LevelFit> fit_;
  std::map<int, double> growth_in_own_logs_;  // by the windows' length: the fit of more rows asks again
};

}  // namespace oted
