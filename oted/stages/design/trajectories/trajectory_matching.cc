#include "oted/stages/design/trajectories/trajectory_matching.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>
#include <optional>

#include "oted/matching/designer.h"
#include "oted/matching/held_out.h"
#include "oted/stages/design/replay/kept_aside.h"
#include "oted/stages/design/trajectories/first_level.h"
#include "oted/stages/design/trajectories/level_fit.h"
#include "oted/stages/design/trajectories/long_windows.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kTolerableGrowth = 1.25;  // of the noise estimate from the first level to a longer one
constexpr int kStartIterations = 5, kLevelIterations = 4;
constexpr double kSamePlace = 0.1;  // in x, some fortieth of the range: two starts that meet need no third
constexpr int kRounds = 2, kRoundIterations = 3;  // of other starts where windows stay unexplained
// The noise estimate and the starts settle at the first level: stiff contacts let them move by small steps only.
constexpr int kFirstLevelIterations = 7;
constexpr double kLongestUnread = 0.6;  // [s]: of short windows where rates are unread
constexpr int kFewestStretches = 16;    // of that length
constexpr int kManyReplays = 50000;     // control steps of a linearization: what noisy logs may take
constexpr double kVisibleNoise = 1e-4;  // of a channel's spread: below is rounding
constexpr double kNearlyAll = 0.9;      // of the windows: no other start, and no length between, tells more
constexpr int kValidationRows = 960;
constexpr int kRowsPerJudged = 3;  // of the last fit: what judges a fit needs it less exactly than who uses it
constexpr int kLongIterations = 20, kMostLongRows = 30000;
constexpr double kMostFinalPhysics = 8e5;  // steps of a linearization of them
constexpr int kLongSteps = kMostLongTries + 2 * kLongIterations;

/// One run of the method, step by step.
class TrajectoryMatch {
 public:
  TrajectoryMatch(const ReplayProblem& problem, const TrajectoriesConfig& config)
      : problem_(problem),
        config_(config),
        space_(problem.factory.parameters()),
        scale_(ChannelScales(problem.dataset)),
        rng_(problem.key.MakeRng()),
        parts_(KeepAside(problem.dataset, problem.factory.spec().control_period_s, problem.kept_aside)) {
    evidence_.scale = {scale_.begin(), scale_.end()};
    Read({});
    ExpectSteps((1 + config.starts) * kStartIterations + StepsOfLevels(shortest_) +
                std::max(kLongSteps, StepsOfLevels(shortest_)));
  }

  ReplayFit Run() {
    const bool explains_all = FitShortWindows(FindStart());
    if (!explains_all || AreBriefAndNoisy()) FitLongWindows(explains_all);
    if (choice_.n_steps == 0 && IsNoisy()) UseMoreRows();
    CountRows();
    if (problem_.judged && !AllLearn() && !of_part_) of_part_ = FitToPart();
    const bool explained = explains_all && choice_.n_steps == 0;
    const MatrixXd covariance = explained ? fit_->Finish() : fit_->CovarianceOfParts() + SpreadOfAsGood();
    if (problem_.judged) evidence_.unseen = FitUnseen();
    problem_.progress(n_done_ + 1, n_done_ + 1, fit_->x());
    return {.mean = fit_->x(), .covariance = covariance, .evidence = evidence_};
  }

 private:
  /// Makes the replayer and the shortest windows. @param computed  as ReadingModel has it
  void Read(const std::vector<char>& computed) {
    const Dataset& logs = problem_.dataset;
    const SimulatorSpec& spec = problem_.factory.spec();
    fit_.reset();
    replayer_ = std::make_unique<WindowReplayer>(MakeReplayer(
        problem_.factory, space_.size(), logs, ReadingModel::Of(spec, logs, computed), problem_.context.n_threads));
    shortest_ = longest_ = ShortestWindow(replayer_->readings());
    // Rates that are fitted as well take longer windows.
    const bool all_read = replayer_->readings().unread.empty() || !(spec.control_period_s > 0);
    const int bound =
        all_read ? config_.window : std::max(config_.window, static_cast<int>(kLongestUnread / spec.control_period_s));
    for (const Episode& episode : logs.Episodes()) {
      while (longest_ * 2 <= std::min(bound, episode.size())) longest_ *= 2;
    }
    const int n_rows = all_read ? config_.rows : std::max(config_.rows, kFewestStretches * longest_);
    first_ = FirstLevel(*replayer_, logs, longest_, shortest_, n_rows, rng_);
    if (first_.windows.empty()) ThrowNothingStartable(logs, spec, shortest_);
  }

  WindowReplayer Replayer(int n_parameters, const Dataset& logs) const {
    return MakeReplayer(problem_.factory, n_parameters, logs, replayer_->readings(), problem_.context.n_threads);
  }

  void Tell(const VectorXd& x) {
    ++n_done_;
    n_total_ = std::max(n_total_, n_done_ + 1);
    problem_.progress(n_done_, n_total_, x);
    problem_.context.ThrowIfStopped();
  }

  /// So many steps are left, at most: the bar leaps ahead where fewer are needed than could have been.
  void ExpectSteps(int n) { n_total_ = n_total_ == 0 ? n : std::min(n_total_, n_done_ + n); }
  /// Of the levels from windows of `length` on, at most.
  int StepsOfLevels(int length) const {
    int n = kFirstLevelIterations + kRounds * kRoundIterations;
    for (; length < longest_; length *= 2) n += kLevelIterations + kRounds * kRoundIterations;
    return n;
  }

  void Descend(LevelFit& fit, int n_iterations) {
    fit.Descend(n_iterations, [&](const VectorXd& x) { Tell(x); });
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
      candidates.emplace_back(CoarseCost(*replayer_, few, scale_, ToZ(space_, x)), x);
      problem_.context.ThrowIfStopped();
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    VectorXd x = candidates.front().second;
    // Exact logs need no fit of starts. Only of the nearest candidate: where there is noise, it is for nothing.
    if (replayer_->readings().ShowsState()) {
      LevelFit fit(*replayer_, space_, problem_.prior, scale_, third, x);
      fit.HoldStarts(true);
      Descend(fit, kStartIterations);
      is_exact_ = fit.ShareWithin(kVisibleNoise * scale_) > kNearlyAll;
      if (is_exact_) return fit.x();
    }
    double best = std::numeric_limits<double>::infinity();
    for (int s = 0; s < std::min(config_.starts, config_.coarse); ++s) {
      LevelFit fit(*replayer_, space_, problem_.prior, scale_, third, candidates[static_cast<size_t>(s)].second);
      Descend(fit, kStartIterations);
      const double cost = fit.FinalCost();
      const bool meets = s > 0 && (fit.x() - x).cwiseAbs().maxCoeff() < kSamePlace;
      if (cost < best) x = fit.x();
      best = std::min(best, cost);
      if (meets || (IsRounding(fit.noise_variance().cwiseSqrt()) && fit.ShareExplained() > kNearlyAll)) break;
    }
    return x;
  }

  /// Longer and longer windows, while they are explained as well as the short ones.
  /// @param again  x is near already
  /// @return whether all were
  bool FitShortWindows(VectorXd x, bool again = false) {
    Level level = first_;
    while (!level.windows.empty()) {
      const bool is_first = fit_ == nullptr;
      auto fit = std::make_unique<LevelFit>(*replayer_, space_, problem_.prior, scale_, level, x);
      const int n_iterations = is_first && !again ? kFirstLevelIterations : kLevelIterations;
      const bool held = is_first && is_exact_;
      ExpectSteps(StepsOfLevels(level.windows.front().n_steps) +
                  (is_exact_ ? 0 : std::max(kLongSteps, StepsOfLevels(shortest_))));
      fit->HoldStarts(held);
      Descend(*fit, n_iterations);
      if (held) {
        fit->HoldStarts(false);
        Descend(*fit, kLevelIterations);
      }
      for (int round = 0; round < kRounds && fit->ShareExplained() < 1; ++round) {
        const bool found = fit->TryOtherStarts(rng_);
        if (round > 0 && !found) break;
        fit->CountExplainedAlone();
        bool settled = false;
        for (int i = 0; i < kRoundIterations && !settled; ++i) {
          settled = fit->Step();
          Tell(fit->x());
        }
      }
      fit->FinalCost();
      const VectorXd noise = fit->noise_variance().cwiseSqrt();
      evidence_.long_noise_std = {noise.begin(), noise.end()};
      if (is_first) evidence_.short_noise_std = evidence_.long_noise_std;
      if (is_first && LeaveOutComputed()) {
        level = first_;
        x = fit->x();
        continue;
      }
      ExpectUnguessed(*fit);
      const double growth = std::exp((noise.array() / SensorNoise().array()).log().mean());
      if (growth > kTolerableGrowth && !IsRounding(noise)) return false;
      x = fit->x();
      evidence_.window = level.windows.front().n_steps;
      evidence_.explained = fit->ShareExplained();
      evidence_.noise_std = evidence_.long_noise_std;
      level = NextLevel(fit->level(), is_first && !IsNoisy() && fit->ShareExplained() > kNearlyAll);
      fit_ = std::move(fit);
    }
    return true;
  }

  /// Windows of twice the length; the longest at once where the shorter ones told all but rounding.
  static Level NextLevel(const Level& level, bool is_known) {
    Level next = Joined(level);
    if (!is_known) return next;
    for (Level longer = Joined(next); !longer.windows.empty(); longer = Joined(longer)) next = longer;
    return next;
  }

  /// Whether there are readings that were computed from others, or that are of an earlier time than they say; they are
  /// left out from here on.
  bool LeaveOutComputed() {
    if (!IsNoisy() || std::ranges::any_of(replayer_->readings().computed, [](char c) { return c != 0; })) return false;
    const std::vector<char> computed = ReadingsLeftOut(problem_.factory.spec(), problem_.dataset, SensorNoise());
    if (std::ranges::none_of(computed, [](char c) { return c != 0; })) return false;
    Read(computed);
    return true;
  }

  /// What no log suggests of a start is expected to be as in the windows that were fitted.
  void ExpectUnguessed(const LevelFit& fit) {
    const ReadingModel& readings = replayer_->readings();
    if (readings.unread.empty()) return;
    const LevelFit::Spread spread = fit.OfUnread();
    for (int k = 0; k < readings.n_unread(); ++k) {
      if (readings.guessed[static_cast<size_t>(k)] == 0) replayer_->Expect(k, spread.mean[k], spread.std[k]);
    }
  }

  /// Whether more than rounding is left.
  bool IsNoisy() const { return !IsRounding(SensorNoise()); }
  bool IsRounding(const VectorXd& noise) const { return (noise.array() <= kVisibleNoise * scale_.array()).all(); }

  /// Whether the windows so far are shorter than the first long ones, and noisy: so brief a window says little of what
  /// adds up, and less where it has to find rates as well.
  bool AreBriefAndNoisy() const {
    const double seconds = evidence_.window * problem_.factory.spec().control_period_s;
    return IsNoisy() && (seconds < kShortestLongWindow || !replayer_->readings().unread.empty());
  }

  /// Noise averages out over rows: once x is near, as many as a budget allows.
  void UseMoreRows() {
    const int n_lanes = 1 + space_.size() + replayer_->state_dim(), n_rows = kManyReplays / n_lanes;
    longest_ = evidence_.window;
    ExpectSteps(StepsOfLevels(shortest_));
    Level more = FirstLevel(*replayer_, problem_.dataset, longest_, shortest_, n_rows, rng_);
    if (more.windows.size() < first_.windows.size() * 5 / 4) return;
    first_ = std::move(more);
    const VectorXd x = fit_->x();
    fit_.reset();
    FitShortWindows(x, true);
  }

  void CountRows() {
    evidence_.logged_rows = problem_.dataset.size();
    for (const LogWindow& window : fit_->level().windows) evidence_.rows += window.n_steps;
  }

  /// Windows of tenths of a second, where they predict better.
  void FitLongWindows(bool explained) {
    ExpectSteps(kLongSteps);
    choice_ = ChooseLongWindows({.factory = problem_.factory,
                                 .learn = parts_.learn,
                                 .recording = parts_.recording,
                                 .prior = problem_.prior,
                                 .readings = replayer_->readings(),
                                 .short_x = fit_->x(),
                                 .noise = SensorNoise(),
                                 .short_steps = evidence_.window,
                                 .explained = explained},
                                problem_.context, [&](const VectorXd& x) { Tell(x); });
    if (choice_.n_steps == 0) return;
    const Level all = LongWindows(*replayer_, problem_.dataset, choice_.n_steps, FinalRows(),
                                  problem_.factory.spec().control_period_s);
    evidence_.window = choice_.n_steps;
    // The part that learns has fewer rows, and most of the way is in all of the logs the same.
    of_part_ = AllLearn() ? choice_.x : FitToPart();
    fit_ = std::make_unique<LevelFit>(*replayer_, space_, problem_.prior, scale_, all, *of_part_);
    fit_->LetErrorsGrow(SensorNoise().cwiseAbs2());
    Descend(*fit_, kLongIterations);
    fit_->FinalCost();
    evidence_.errors_grow = true;
    evidence_.left_out = choice_.left_out;
  }

  /// Mean square of how far the fits by other lengths of windows lie that predict as well: no length is the right one.
  MatrixXd SpreadOfAsGood() const {
    MatrixXd square = MatrixXd::Zero(space_.size(), space_.size());
    for (const VectorXd& x : choice_.as_good) square += (x - fit_->x()) * (x - fit_->x()).transpose();
    return square / static_cast<double>(std::max<size_t>(1, choice_.as_good.size()));
  }

  /// What has not seen the logs that were kept aside.
  UnseenFit FitUnseen() {
    const ReadingModel& readings = replayer_->readings();
    return {.z = AllLearn() ? std::vector<double>{} : ToZ(space_, *of_part_),
            .computed = readings.computed,
            .mean = {readings.mean.begin(), readings.mean.end()},
            .std = {readings.std.begin(), readings.std.end()}};
  }

  /// Whether nothing could be kept aside.
  bool AllLearn() const { return parts_.judge.size() == problem_.dataset.size(); }

  /// x by the part of the logs that learns alone, settled as that by all of them.
  VectorXd FitToPart() {
    const bool is_long = choice_.n_steps > 0;
    if (!is_long && !is_exact_) {
      if (std::optional<VectorXd> x = WithoutWhatJudges()) return *std::move(x);
    }
    WindowReplayer learner = Replayer(space_.size(), parts_.learn);
    const double period = problem_.factory.spec().control_period_s;
    const int n_rows = is_long ? FinalRows() / kRowsPerJudged : kValidationRows;
    const int begins = is_long || is_exact_ ? evidence_.window : shortest_;
    const VectorXd from = is_long ? choice_.x : fit_->x();
    const VectorXd scale = ChannelScales(parts_.learn);
    const auto make = [&](Level level, VectorXd x) {
      auto fit = std::make_unique<LevelFit>(learner, space_, problem_.prior, scale, std::move(level), std::move(x));
      if (is_long) fit->LetErrorsGrow(SensorNoise().cwiseAbs2());
      fit->HoldStarts(is_exact_);
      return fit;
    };
    const auto descend = [&](LevelFit& fit, bool) { Descend(fit, is_long ? kLongIterations : kLevelIterations); };
    const std::unique_ptr<LevelFit> fit = FitGrowing(LongWindows(learner, parts_.learn, begins, n_rows, period), from,
                                                     evidence_.window, 1, make, descend);
    return fit == nullptr ? from : fit->x();
  }

  /// The fit of short windows, going on without those that hold a row that judges: their starts were found from windows
  /// half as long, and those of a fit that begins with noisy readings end in local minima. None where few are left.
  std::optional<VectorXd> WithoutWhatJudges() {
    std::vector<char> judges(static_cast<size_t>(problem_.dataset.size()), 1);
    for (const int row : parts_.learned_rows) judges[static_cast<size_t>(row)] = 0;
    std::vector<char> left_out;
    for (const LogWindow& window : fit_->level().windows) {
      const auto first = judges.begin() + window.begin;
      left_out.push_back(std::find(first, first + window.n_steps, 1) != first + window.n_steps ? 1 : 0);
    }
    if (std::ranges::count(left_out, 0) < kFewestStretches) return std::nullopt;
    LevelFit rest = fit_->LeavingOut(left_out);
    Descend(rest, kLevelIterations);
    rest.FinalCost();
    rest.Finish();
    return rest.x();
  }

  /// Of the last fit of long windows.
  int FinalRows() const {
    return AffordableRows(kMostLongRows, kMostFinalPhysics, problem_.factory, replayer_->readings());
  }

  /// (obs_dim): what the shortest windows leave.
  VectorXd SensorNoise() const { return Eigen::Map<const VectorXd>(evidence_.short_noise_std.data(), scale_.size()); }

  const ReplayProblem& problem_;
  const TrajectoriesConfig& config_;
  const ParameterSpace& space_;
  std::unique_ptr<WindowReplayer> replayer_;
  VectorXd scale_;
  bool is_exact_ = false;  // the logs, but for rounding: their readings are the states
  Rng rng_;
  HeldOutParts parts_;
  int shortest_ = 0, longest_ = 0;  // control steps of the windows that are joined
  Level first_;
  std::unique_ptr<LevelFit> fit_;
  LongFitChoice choice_;
  std::optional<VectorXd> of_part_;  // by the part that learns
  FitEvidence evidence_;
  int n_done_ = 0, n_total_ = 0;
};

}  // namespace

ReplayFit MatchTrajectories(const ReplayProblem& problem, const TrajectoriesConfig& config) {
  return TrajectoryMatch(problem, config).Run();
}

}  // namespace oted
