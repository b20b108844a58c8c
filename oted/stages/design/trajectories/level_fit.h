#pragma once
/// One level of trajectory matching: windows of one length, fitted together (trajectory_matching.h has the cost).

#include <Eigen/Dense>
#include <functional>
#include <optional>
#include <vector>

#include "oted/matching/prior.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/replay/start_fit.h"
#include "oted/stages/design/replay/window_likelihood.h"
#include "oted/stages/design/replay/windows.h"
#include "oted/stages/design/trajectories/stretch_estimate.h"

namespace oted {

inline constexpr double kFarthestX = 14.0;  ///< a millionth of the range

/// How low each x may go: |x| is at most kMaxX, but what may be nothing, such as friction, may come as near to 0 as a
/// millionth of its range. Held where a sensor can tell it from nothing it would move the others.
Eigen::VectorXd LowestX(const ParameterSpace& space);

/// Windows of one length with their start states, as far as they are known.
struct Level {
  std::vector<LogWindow> windows;
  std::vector<Eigen::VectorXd> starts;
  std::vector<int> stretch;  ///< which stretch of the log each window is part of
};

/// Whether windows of `n_steps` can be joined and be no longer than `longest`: they grow by doubling.
constexpr bool CanGrow(int n_steps, int longest) { return 2 * n_steps <= longest; }

/// Windows of twice the length, each from two neighbours; it starts where the first of them does.
Level Joined(const Level& level);

/// Everything that one level of windows needs to be fitted. What it is given must outlive it.
class LevelFit {
 public:
  /// @param scale  (obs_dim): ChannelScales
  LevelFit(WindowReplayer& replayer, const ParameterSpace& space, const Prior& prior, const Eigen::VectorXd& scale,
           Level level, Eigen::VectorXd x);

  /// From now on errors add up over a window: `variance` is that of the sensors, and noise_variance that of the
  /// simulator's errors at a window's end (WindowLikelihood::Growing). Readings that err as one count as one: the prior
  /// weighs as much more, and what the logs hardly tell stays near its mean.
  void LetErrorsGrow(Eigen::VectorXd variance) { sensor_variance_ = std::move(variance); }

  /// While starts are held, windows start where their readings say: for logs that are exact but for rounding. Step once
  /// after they are let go.
  void HoldStarts(bool held) {
    starts_are_held_ = held;
    kept_.assign(kept_.size(), 0);
  }

  const Eigen::VectorXd& x() const { return x_; }
  std::vector<double> z() const { return ToZ(space_, x_); }
  const Level& level() const { return level_; }
  const ReadingModel& readings() const { return replayer_.readings(); }
  int n_rows() const { return static_cast<int>(level_.windows.size()) * n_steps(); }  ///< that it rests on
  const Eigen::VectorXd& noise_variance() const { return variance_; }

  /// One Gauss-Newton step on x and all starts. Windows whose derivatives foretold the last step keep them; where the
  /// step gains nothing by those, all are taken anew.
  /// @return whether x moved by less than a quarter of its uncertainty, by derivatives that were all taken anew
  bool Step();
  /// Steps until x has settled, `n_iterations` at most. @param tell  called with x after each
  void Descend(int n_iterations, const std::function<void(const Eigen::VectorXd&)>& tell);
  /// Windows that are not explained are often caught in a local minimum of their start: noise of a hundredth of a metre
  /// puts a foot into the ground. Each is fitted again from other starts, from where the replay of the window before it
  /// ends and from readings with noise added anew, and keeps the best. Call Step before and after.
  /// @return whether any window found a better start
  bool TryOtherStarts(Rng& rng);
  /// From now on windows that are not explained do not count at all, unless hardly any is: what x they ask for is that
  /// of a wrong start.
  void CountExplainedAlone();
  /// The same fit, going on without the windows of which a flag is set. Its first step takes the derivatives that are
  /// there, unless it gains nothing by them: where they were taken near the minimum, as a jackknife does.
  LevelFit LeavingOut(const std::vector<char>& flags) const;
  /// The same of every k-th window, so many that they hold `n_rows` at least; all windows where there are fewer.
  LevelFit Sampled(int n_rows) const;
  /// The same of the windows that it explains worst, so many that they hold `n_rows` at least. @param explained_alone
  /// whether those that are not explained do not count (CountExplainedAlone)
  LevelFit WorstExplained(int n_rows, bool explained_alone) const;
  /// Negative log likelihood at the present x, starts and noise, after Step; comparable between fits of the same
  /// windows.
  double FinalCost();
  /// The last step, after FinalCost: an undamped Newton step on x with derivatives that are secants over the scale of
  /// the uncertainty, of x and of every start. Under noise the cost is rough at a smaller scale, since contacts begin
  /// and end a physics step earlier or later; tangents tell nothing of that, or everything. From an x that is near, one
  /// such step is as good as the minimum (Le Cam's one-step estimator). On clean logs secants are tangents. From an x
  /// that is farther than that, it takes another.
  /// @return the covariance of x
  Eigen::MatrixXd Finish();
  /// In place of the last step, where the family does not explain the logs (EstimateFromParts): x was chosen by what it
  /// predicts, and stays. @return the covariance of x
  Eigen::MatrixXd CovarianceOfParts();
  /// Behind Finish or CovarianceOfParts: the covariance of x as far as the sensors' noise makes it. Where errors grow,
  /// the simulator's errors have no part in it; nor has what sensors surely do not err by.
  /// @param largest_noise  (obs_dim): that, as standard deviations (LargestNoise)
  Eigen::MatrixXd CovarianceOfNoise(const Eigen::VectorXd& largest_noise) const;
  /// What each stretch of the log says of x and, behind it, of the parameters that `wider` has after those of x. By the
  /// secants of Finish, and by one step of each of these.
  /// @param nominal, moved  their z before the step, and after it
  /// @param steps           what each step is called: the unit of what is told of them
  std::vector<StretchEvidence> EvidenceIn(WindowReplayer& wider, const std::vector<double>& nominal,
                                          const std::vector<double>& moved, const Eigen::VectorXd& steps) const;
  /// Whether noise alone explains a window, after FinalCost.
  bool Explains(size_t w) const { return Likelihood().Explains(residuals_[w]); }
  /// Share of windows that noise alone explains, after FinalCost.
  double ShareExplained() const;
  /// By how many nats windows are less likely at `x` than at `than`, their starts fitted anew at both. Behind Finish or
  /// CovarianceOfParts.
  double NatsLostAt(const Eigen::VectorXd& x, const Eigen::VectorXd& than) const;
  /// How unlikely windows are, their starts fitted anew, but for a constant. After FinalCost.
  /// @param wider, z  as Gained has them
  double NatsIn(WindowReplayer& wider, const std::vector<double>& z) const;
  /// By how many nats windows become likelier elsewhere than at z, their starts fitted anew. After FinalCost.
  class Gained {
   public:
    /// @param fit    must outlive it
    /// @param wider  of a simulator that may have more parameters, behind those of x
    /// @param z      of all its parameters
    Gained(const LevelFit& fit, WindowReplayer& wider, const std::vector<double>& z);
    /// The same of its own parameters, from where they are.
    explicit Gained(const LevelFit& fit) : Gained(fit, fit.replayer_, fit.z()) {}
    double At(const std::vector<double>& value) const;

   private:
    const LevelFit& fit_;
    WindowReplayer& wider_;
    std::vector<Eigen::VectorXd> replayed_, settled_;  // residuals at z: by the starts that are there, by those fitted
  };
  /// Share of windows whose start has another local minimum near: moved by as much as it is uncertain and fitted again,
  /// it comes to rest elsewhere, better or worse. After Finish.
  double ShareAtOtherMinima(Rng& rng) const;
  /// Share of windows of which no reading is farther off than its channel's `tolerance`.
  double ShareWithin(const Eigen::VectorXd& tolerance) const;
  /// Mean and standard deviation, over the windows, of each unread coordinate's start, its own uncertainty included;
  /// after Step.
  struct Spread {
    Eigen::VectorXd mean, std;  ///< (n_unread)
  };
  Spread OfUnread() const;

 private:
  /// The quadratic model of one window's cost, weighted.
  struct NormalEquations {
    using Factor = Eigen::LDLT<Eigen::MatrixXd>;
    bool valid = false;
    Eigen::MatrixXd start_start, start_x, x_x;
    Eigen::VectorXd start, x;
    /// What is left for x when the start follows it (Schur complements). @param factor  of start_start, damped or not
    Eigen::MatrixXd Information(const Factor& factor) const {
      return x_x - start_x.transpose() * factor.solve(start_x);
    }
    Eigen::VectorXd Score(const Factor& factor) const { return x - start_x.transpose() * factor.solve(start); }
  };

  int n_steps() const { return level_.windows.front().n_steps; }
  WindowLikelihood Likelihood() const {
    const ReadingModel& readings = replayer_.readings();
    if (sensor_variance_.size() > 0) return WindowLikelihood::Growing(readings, sensor_variance_, variance_, n_steps());
    return {readings, variance_, n_steps()};
  }
  /// Each window keeps the better of its two starts at x: one whose contact flips does not hold up the others. The old
  /// one is replayed only where the new one is worse than derivatives foretell of the old one.
  /// @param moved  residuals of the new starts; on return of the better ones
  /// @return which windows' new start is better
  std::vector<char> TakeBetterStarts(std::vector<Eigen::VectorXd>& moved, const Eigen::VectorXd& x,
                                     const WindowLikelihood& likelihood) const;
  /// The windows' starts at x, from `starts` on; these where they are held.
  FittedStarts Settled(std::vector<Eigen::VectorXd> starts, const Eigen::VectorXd& x) const {
    return SettledIn(replayer_, std::move(starts), ToZ(space_, x));
  }
  /// The same in another simulator. @param z  of all its parameters
  FittedStarts SettledIn(WindowReplayer& replayer, std::vector<Eigen::VectorXd> starts,
                         const std::vector<double>& z) const {
    return SettledIn(replayer, level_.windows, std::move(starts), z);
  }
  FittedStarts SettledIn(WindowReplayer& replayer, const std::vector<LogWindow>& windows,
                         std::vector<Eigen::VectorXd> starts, const std::vector<double>& z) const;
  /// Where the replay of the window before window w ends; none where that is not its neighbour.
  std::optional<Eigen::VectorXd> PredictedStart(size_t w) const;
  /// Of all windows; without the prior.
  double CostOfWindows(const std::vector<Eigen::VectorXd>& residuals) const;
  double Cost(const std::vector<Eigen::VectorXd>& residuals, const Eigen::VectorXd& x) const {
    return readings_per_error_ * prior_.HalfSquare(x) + CostOfWindows(residuals);
  }
  /// Forward differences of these steps: (parameters), and of each window (state_dim), none where starts are held.
  struct Differences {
    Eigen::VectorXd x;
    std::vector<Eigen::VectorXd> starts;
  };
  Eigen::VectorXd StartSteps() const;
  Differences Tangents() const;
  Differences Secants() const;
  struct LastStep {
    Eigen::MatrixXd covariance;
    bool arrived = false;  // it was not cut short
  };
  LastStep TakeLastStep();
  /// Of all windows, or of some.
  void Linearize(const Differences& steps);
  void Linearize(const std::vector<size_t>& which, const Differences& steps);
  /// The windows of which a flag is not set.
  static std::vector<size_t> Without(const std::vector<char>& flags);
  /// z with one search coordinate moved by its step, one per parameter.
  std::vector<std::vector<double>> Perturbed(const Eigen::VectorXd& steps) const;
  /// What each stretch says of the parameters of a linearization. A window that cannot be replayed says nothing.
  std::vector<StretchEvidence> Evidence(const std::vector<WindowReplayer::Linearization>& linear,
                                        Eigen::Index n_parameters) const;
  /// The channels' variances, and from them the windows' weights.
  void EstimateNoise();
  std::vector<NormalEquations> Equations(const std::vector<WindowReplayer::Linearization>& linear) const;

  WindowReplayer& replayer_;
  const ParameterSpace& space_;
  const Prior& prior_;
  const Eigen::VectorXd& scale_;
  Level level_;
  Eigen::VectorXd x_;
  std::vector<double> damping_of_start_;
  double damping_ = 1e-2;
  bool explained_alone_ = false, starts_are_held_ = false;
  std::vector<WindowReplayer::Linearization> linear_;
  std::vector<char> kept_;   // of each window: its derivatives do for the next step,
  std::vector<char> fresh_;  // they are those of its present start and x
  std::vector<Eigen::VectorXd> residuals_;
  Eigen::VectorXd variance_;         // of each channel's noise, or of what grows
  Eigen::VectorXd sensor_variance_;  // empty unless errors grow
  std::vector<double> weights_;      // of each window
  double readings_per_error_ = 1;    // CorrelationTime, where errors grow
};

}  // namespace oted
