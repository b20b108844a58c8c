#pragma once
/// Open-loop prediction of logged episodes: what a designed simulator is for.

#include <Eigen/Dense>
#include <functional>
#include <vector>

#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/stages/design/replay/prediction_ratios.h"
#include "oted/stages/design/replay/start_fit.h"
#include "oted/stages/design/replay/windows.h"

namespace oted {

/// The lead of a window [control steps]: the readings that its start is fitted to, as PredictionJudge has it.
/// @param period_s  control period [s]; 0 where time has no unit
int LeadSteps(const ReadingModel& readings, double period_s);

/// How well simulators predict logged episodes, open loop: each window's start is fitted to its first readings (the
/// lead), as the simulator at z sees them, and the rest is predicted. What it is given must outlive it.
class PredictionJudge {
 public:
  /// Windows are spread evenly over the logs. Those that are predicted over a horizon overlap by half of it at most.
  /// @param noise     (obs_dim): standard deviation of each channel's noise, what short windows leave
  /// @param horizons  in ascending order: control steps that are predicted. Those that no episode lasts are left out;
  ///                  where none is left, the longest episode is predicted to its end
  /// @param period_s  control period [s]: the lead is 0.05 s, at least four steps; 0.1 s where readings do not show all
  ///                  of a state
  /// @param most      windows
  PredictionJudge(WindowReplayer& replayer, const Dataset& logs, const Eigen::VectorXd& noise,
                  std::vector<int> horizons, double period_s, int most = 200);
  /// Of stretches of the caller's choice, for pictures. @param rows  where they begin; @param n_steps  control steps
  /// that are predicted behind the lead
  PredictionJudge(WindowReplayer& replayer, const Dataset& logs, const Eigen::VectorXd& noise,
                  const std::vector<int>& rows, int n_steps, double period_s);
  /// Of the windows of `other`, by another replayer of its logs.
  PredictionJudge(WindowReplayer& replayer, const PredictionJudge& other);
  /// Of the windows of `other`, in logs that it imitated.
  PredictionJudge(WindowReplayer& replayer, const Dataset& imitated, const PredictionJudge& other);

  /// In control steps; empty where no episode is long enough.
  const std::vector<int>& horizons() const { return horizons_; }
  /// Whose start is fitted.
  int n_windows() const { return static_cast<int>(windows_.size()); }
  /// That are predicted over horizons()[h].
  int n_windows(size_t h) const { return static_cast<int>(lasting_[h].size()); }
  /// How many of them, the first ones, begin in the first `n_episodes` episodes.
  int n_windows(size_t h, int n_episodes) const;
  /// The rows that they begin at.
  std::vector<int> Begins(size_t h) const;
  /// What errors are judged by.
  const JudgedChannels& channels() const { return channels_; }

  /// Mean squared errors; NaN where the physics broke down.
  struct Squares {
    std::vector<Eigen::MatrixXd> predicted;  ///< by horizon: (channels, windows that last so long)
    Eigen::MatrixXd lead;                    ///< (channels, windows): of the readings that each start was fitted to
    std::vector<Eigen::VectorXd> starts;     ///< of each window
  };
  Squares Predict(const std::vector<double>& z) const;
  /// The same from where the readings alone say that windows begin, whatever the simulator is.
  Squares PredictFromReadings(const std::vector<double>& z) const;
  /// (channels): the error of the best guess at horizons()[h], as HeldOutPrediction::Channel::guess.
  Eigen::VectorXd Guess(size_t h) const;
  /// (judged channels, windows): mean squared errors over the longest horizon, the noise's variance added; at most the
  /// channel's variance over the logs.
  Eigen::MatrixXd MeanSquares(const std::vector<double>& z) const;
  /// Logged minus simulated, of the lead and all predicted steps (as WindowReplayer::Residuals), where the simulator at
  /// z begins so that it follows the window best: three leads, then stretches twice as long, to its end. Where small
  /// errors grow, a start that was fitted to a lead alone soon leads elsewhere: a hopper that has fallen is predicted
  /// with ease, and the floor would be that of another motion than the logs'.
  /// @param starts  Predict's
  /// @param tell    called FollowSteps() times on the way
  std::vector<Eigen::VectorXd> Follow(const std::vector<double>& z, const std::vector<Eigen::VectorXd>& starts,
                                      const std::function<void()>& tell) const;
  int FollowSteps() const;
  /// What a simulator would have logged in place of the windows, each an episode behind up to 16 rows of what was
  /// logged before it: the logged actions, and noise of standard deviation `noise` (obs_dim) on every reading. A window
  /// in which its physics broke down stays as it was logged.
  /// @param followed  what Follow gave
  Dataset Imitate(const std::vector<Eigen::VectorXd>& followed, const Eigen::VectorXd& noise, Rng& rng) const;

 private:
  /// Of windows of `whole` steps, how many are fitted after `n_fitted` were (0: none yet).
  int NextFollowed(int n_fitted, int whole) const;
  /// Into windows_: those of so many steps.
  std::vector<size_t> WindowsOf(int n_steps) const;
  /// The starts of windows, fitted to their first steps.
  FittedStarts Fit(const std::vector<double>& z, std::vector<LogWindow> windows, int n_steps,
                   std::vector<Eigen::VectorXd> starts) const;
  /// The same of the leads. Where rates are unread, leads that are not explained were often caught in a local minimum,
  /// by a contact: they are fitted again to more and more of their readings, and the better start is kept.
  std::vector<Eigen::VectorXd> FitLeads(const std::vector<double>& z, const std::vector<LogWindow>& windows,
                                        const std::vector<Eigen::VectorXd>& guesses) const;
  /// All windows to their ends, from where they were logged or where their leads say.
  FittedStarts Replay(const std::vector<double>& z, bool fits_leads) const;
  Squares SquaresOf(FittedStarts replays) const;
  /// How many rows before a window its imitation holds.
  int RowsBefore(const LogWindow& window) const;

  WindowReplayer& replayer_;
  const Dataset& logs_;
  Eigen::VectorXd variance_, start_step_;
  JudgedChannels channels_;
  int n_lead_ = 0;
  std::vector<int> horizons_;
  std::vector<LogWindow> windows_;         // n_steps: the lead and what is predicted
  std::vector<std::vector<int>> lasting_;  // by horizon: into windows_
};

/// How much farther `a` predicts off than `b`: the mean over channels of the log of the ratio of mean squares, and the
/// standard error of that (delete-one jackknife over windows).
struct PredictionRatio {
  double log_ratio = 0, std = 0;
};
/// @param a, b  (channels, windows): PredictionJudge::MeanSquares
PredictionRatio ComparePredictions(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

}  // namespace oted
