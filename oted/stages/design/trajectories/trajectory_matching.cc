#include "oted/stages/design/trajectories/trajectory_matching.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>

#include "oted/matching/designer.h"
#include "oted/matching/held_out.h"
#include "oted/stages/design/trajectories/level_fit.h"
#include "oted/stages/design/trajectories/long_windows.h"
#include "oted/stages/design/trajectories/suspects.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTolerableGrowth = 1.25;  // of the noise estimate from the first level to a longer one
constexpr int kFirstWindow = 2;
constexpr int kStartIterations = 5, kLevelIterations = 4;
constexpr int kRounds = 2, kRoundIterations = 3;  // of other starts where windows stay unexplained
// The noise estimate and the starts settle at the first level: stiff contacts let them move by small steps only.
constexpr int kFirstLevelIterations = 7;
constexpr size_t kManyEpisodes = 5;
constexpr int kBlocksPerJudged = 5;
constexpr double kHeldOutBlock = 2.0;       // [s]
constexpr double kLongestPrediction = 1.0;  // [s]
constexpr double kVisibleNoise = 1e-4;      // of a channel's spread: below is rounding
constexpr int kValidationRows = 960;
constexpr int kLongIterations = 8, kMostLongRows = 30000;
constexpr int kFewestIterations = 3;  // the starts need them where x does not

/// Stretches of the log of `length` rows in a random order, until they hold `n_rows`; cut into the first level's
/// windows.
Level FirstLevel(WindowReplayer& replayer, const Dataset& dataset, int length, int n_rows, Rng& rng) {
  Level level;
  int n_stretches = 0;
  for (const LogWindow& stretch : DrawStretches(dataset, length, n_rows, rng)) {
    for (int i = stretch.begin; i + kFirstWindow <= stretch.begin + length; i += kFirstWindow) {
      const LogWindow window{i, kFirstWindow, stretch.episode_begin};
      if (!replayer.CanStart(window)) continue;
      level.windows.push_back(window);
      level.starts.push_back(replayer.Logged(window, 0));
      level.stretch.push_back(n_stretches);
    }
    ++n_stretches;
  }
  return level;
}

/// How well z explains one-step replays from the logged states: the log of each channel's error, the worst fifth of the
/// windows left out.
double CoarseCost(WindowReplayer& replayer, const Level& level, const VectorXd& scale, const std::vector<double>& z) {
  const std::vector<VectorXd> residuals = replayer.Residuals(level.windows, level.starts, z);
  double cost = 0;
  for (int c = 0; c < scale.size(); ++c) {
    std::vector<double> errors;
    for (const VectorXd& residual : residuals) {
      double error = 1e6;
      if (residual.size() > 0) {
        error = 0;
        for (int t = 1; t <= kFirstWindow; ++t) error += std::pow(residual[t * scale.size() + c] / scale[c], 2);
      }
      errors.push_back(error);
    }
    std::sort(errors.begin(), errors.end());
    errors.resize(std::max<size_t>(1, errors.size() * 4 / 5));
    cost += std::log(std::accumulate(errors.begin(), errors.end(), 1e-14) / static_cast<double>(errors.size()));
  }
  return cost;
}

/// Steps until x has settled.
void Descend(LevelFit& fit, int n_iterations, const std::function<void(const VectorXd&)>& tell) {
  for (int i = 0; i < n_iterations; ++i) {
    const bool settled = fit.Step();
    tell(fit.x());
    if (settled && i + 1 >= kFewestIterations) return;
  }
}

/// The first `n` windows of a level.
Level Leading(const Level& level, size_t n) {
  Level part = level;
  part.windows.resize(std::min(n, level.windows.size()));
  part.starts.resize(part.windows.size());
  part.stretch.resize(part.windows.size());
  return part;
}

/// Logs to fit and logs to judge by: whole episodes, but where they are few, each may be of another kind of motion, and
/// every fifth block of two seconds is kept aside (of a shorter episode its last fifth).
HeldOutParts PartsOf(const Dataset& dataset, double period_s, RngKey key) {
  const std::vector<Episode> episodes = dataset.Episodes();
  if (episodes.size() >= kManyEpisodes || !(period_s > 0)) return HoldOut(dataset, key);
  std::vector<Episode> learn, judge;
  for (const Episode& whole : episodes) {
    const int block =
        std::min(static_cast<int>(std::lround(kHeldOutBlock / period_s)), whole.size() / kBlocksPerJudged);
    if (block < 1) return {dataset, dataset};
    int begin = whole.begin;  // of what was not given to either
    for (int k = kBlocksPerJudged - 1; whole.begin + (k + 1) * block <= whole.end; k += kBlocksPerJudged) {
      const int middle = whole.begin + k * block, end = middle + block;
      learn.push_back({begin, middle, false});
      judge.push_back({middle, end, whole.terminated && end == whole.end});
      begin = end;
    }
    if (begin < whole.end) learn.push_back({begin, whole.end, whole.terminated});
  }
  return {dataset.Select(learn), dataset.Select(judge)};
}

/// One run of the method, step by step.
class TrajectoryMatch {
 public:
  TrajectoryMatch(const ReplayProblem& problem, const TrajectoriesConfig& config)
      : problem_(problem),
        config_(config),
        space_(problem.factory.parameters()),
        replayer_(MakeReplayer(space_.size(), problem.dataset)),
        scale_(ChannelScales(problem.dataset)),
        rng_(problem.key.MakeRng()),
        parts_(PartsOf(problem.dataset, problem.factory.spec().control_period_s, problem.key.Stage("held out"))) {
    evidence_.scale = {scale_.begin(), scale_.end()};
    int longest = kFirstWindow;
    for (const Episode& episode : problem.dataset.Episodes()) {
      while (longest * 2 <= std::min(config.window, episode.size())) longest *= 2;
    }
    first_ = FirstLevel(replayer_, problem.dataset, longest, config.rows, rng_);
    if (first_.windows.empty()) ThrowNothingStartable(problem.dataset, problem.factory.spec(), kFirstWindow);
    n_total_ = config.starts * kStartIterations + kFirstLevelIterations + kRounds * kRoundIterations;
    for (int length = kFirstWindow; length < longest; length *= 2) {
      n_total_ += kLevelIterations + kRounds * kRoundIterations;
    }
  }

  ReplayFit Run() {
    const bool explains_all = FitShortWindows(FindStart());
    if (!explains_all || AreBriefAndNoisy()) FitLongWindows();
    const MatrixXd covariance = fit_->Finish();
    evidence_.suspects =
        FindSuspects(problem_.factory, problem_.dataset, *fit_, problem_.prior, problem_.context.n_threads);
    evidence_.held_out = Validate();
    problem_.progress(n_total_, n_total_, fit_->x());
    return {.mean = fit_->x(), .covariance = covariance, .evidence = evidence_};
  }

 private:
  WindowReplayer MakeReplayer(int n_parameters, const Dataset& logs) const {
    const int n_lanes = WindowReplayer::LinearizationLanes(n_parameters, problem_.factory.spec().obs_dim());
    return WindowReplayer(problem_.factory.Make(n_lanes, problem_.context.n_threads), logs);
  }

  void Tell(const VectorXd& x) {
    problem_.progress(std::min(++n_done_, n_total_), n_total_, x);
    problem_.context.ThrowIfStopped();
  }

  void Descend(LevelFit& fit, int n_iterations) {
    ::oted::Descend(fit, n_iterations, [&](const VectorXd& x) { Tell(x); });
  }

  /// Of the prior's draws that explain single steps best, and the nominal parameters, the one that descends farthest.
  VectorXd FindStart() {
    const Level few = Leading(first_, 40), third = Leading(first_, std::max<size_t>(40, first_.windows.size() / 3));
    std::vector<std::pair<double, VectorXd>> candidates;
    const VectorXd nominal = NominalStart(space_);
    for (int k = 0; k < config_.coarse; ++k) {
      VectorXd x = nominal;
      if (k > 0) {
        for (double& coordinate : x) coordinate = rng_.Normal();
        x = problem_.prior.mean + problem_.prior.factor * x;
      }
      candidates.emplace_back(CoarseCost(replayer_, few, scale_, ToZ(space_, x)), x);
      problem_.context.ThrowIfStopped();
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    VectorXd x = candidates.front().second;
    double best = std::numeric_limits<double>::infinity();
    for (int s = 0; s < std::min(config_.starts, config_.coarse); ++s) {
      LevelFit fit(replayer_, space_, problem_.prior, scale_, third, candidates[static_cast<size_t>(s)].second);
      n_planned_ += kStartIterations;
      Descend(fit, kStartIterations);
      n_done_ = n_planned_;
      const double cost = fit.FinalCost();
      if (cost < best) x = fit.x();
      best = std::min(best, cost);
    }
    return x;
  }

  /// Longer and longer windows, while they are explained as well as the short ones.
  /// @return whether all were
  bool FitShortWindows(VectorXd x) {
    Level level = first_;
    while (!level.windows.empty()) {
      const bool is_first = fit_ == nullptr;
      auto fit = std::make_unique<LevelFit>(replayer_, space_, problem_.prior, scale_, level, x);
      const int n_iterations = is_first ? kFirstLevelIterations : kLevelIterations;
      n_planned_ += n_iterations + kRounds * kRoundIterations;
      Descend(*fit, n_iterations);
      for (int round = 0; round < kRounds && fit->TryOtherStarts(rng_); ++round) {
        fit->CountExplainedAlone();
        for (int i = 0; i < kRoundIterations; ++i) {
          fit->Step();
          Tell(fit->x());
        }
      }
      n_done_ = n_planned_;
      fit->FinalCost();
      const VectorXd noise = fit->noise_variance().cwiseSqrt();
      evidence_.long_noise_std = {noise.begin(), noise.end()};
      if (is_first) evidence_.short_noise_std = evidence_.long_noise_std;
      const double growth = std::exp((noise.array() / SensorNoise().array()).log().mean());
      if (growth > kTolerableGrowth) return false;
      x = fit->x();
      evidence_.window = level.windows.front().n_steps;
      evidence_.explained = fit->ShareExplained();
      evidence_.noise_std = evidence_.long_noise_std;
      level = fit->Joined();
      fit_ = std::move(fit);
    }
    return true;
  }

  /// Whether the windows so far are shorter than the first long ones, and more than rounding is left: so brief a window
  /// says little of what adds up.
  bool AreBriefAndNoisy() const {
    const double seconds = evidence_.window * problem_.factory.spec().control_period_s;
    return seconds < kShortestLongWindow && (SensorNoise().array() > kVisibleNoise * scale_.array()).any();
  }

  /// Windows of tenths of a second, where they predict better.
  void FitLongWindows() {
    choice_ = ChooseLongWindows({.factory = problem_.factory,
                                 .learn = parts_.learn,
                                 .judge = parts_.judge,
                                 .prior = problem_.prior,
                                 .short_x = fit_->x(),
                                 .noise = SensorNoise(),
                                 .short_steps = evidence_.window},
                                problem_.context, [&](const VectorXd& x) { Tell(x); });
    if (choice_.n_steps == 0) return;
    const Level all = LongWindows(replayer_, problem_.dataset, choice_.n_steps, kMostLongRows,
                                  problem_.factory.spec().control_period_s);
    fit_ = std::make_unique<LevelFit>(replayer_, space_, problem_.prior, scale_, all, choice_.x);
    fit_->LetErrorsGrow(SensorNoise().cwiseAbs2());
    Descend(*fit_, kLongIterations);
    fit_->FinalCost();
    evidence_.window = choice_.n_steps;
  }

  /// How parameters fitted to one part of the logs predict the other.
  std::optional<HeldOutPrediction> Validate() {
    const double period = problem_.factory.spec().control_period_s;
    if (!(period > 0) || parts_.judge.size() == problem_.dataset.size()) return std::nullopt;
    VectorXd x = choice_.x;
    if (choice_.n_steps == 0) {
      WindowReplayer learner = MakeReplayer(space_.size(), parts_.learn);
      const Level level = LongWindows(learner, parts_.learn, evidence_.window, kValidationRows, period);
      if (level.windows.empty()) return std::nullopt;
      const VectorXd scale = ChannelScales(parts_.learn);
      LevelFit fit(learner, space_, problem_.prior, scale, level, fit_->x());
      Descend(fit, kLevelIterations);
      x = fit.x();
    }
    WindowReplayer replayer = MakeReplayer(0, parts_.judge);
    PredictionJudge judge(replayer, parts_.judge, SensorNoise(),
                          static_cast<int>(std::lround(kLongestPrediction / period)), period);
    HeldOutPrediction prediction = PredictHeldOut(judge, space_.Nominal(), ToZ(space_, x), period);
    return prediction.horizons.empty() ? std::nullopt : std::optional(std::move(prediction));
  }

  /// (obs_dim): what the shortest windows leave.
  VectorXd SensorNoise() const { return Eigen::Map<const VectorXd>(evidence_.short_noise_std.data(), scale_.size()); }

  const ReplayProblem& problem_;
  const TrajectoriesConfig& config_;
  const ParameterSpace& space_;
  WindowReplayer replayer_;
  VectorXd scale_;
  Rng rng_;
  HeldOutParts parts_;
  Level first_;
  std::unique_ptr<LevelFit> fit_;
  LongFitChoice choice_;
  FitEvidence evidence_;
  int n_done_ = 0, n_planned_ = 0, n_total_ = 0;
};

}  // namespace

ReplayFit MatchTrajectories(const ReplayProblem& problem, const TrajectoriesConfig& config) {
  return TrajectoryMatch(problem, config).Run();
}

}  // namespace oted
