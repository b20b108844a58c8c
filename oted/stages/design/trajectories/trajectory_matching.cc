#include "oted/stages/design/trajectories/trajectory_matching.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>

#include "oted/matching/designer.h"
#include "oted/matching/held_out.h"
#include "oted/matching/verdict.h"
#include "oted/stages/design/replay/kept_aside.h"
#include "oted/stages/design/replay/noise_bound.h"
#include "oted/stages/design/trajectories/first_level.h"
#include "oted/stages/design/trajectories/fit_steps.h"
#include "oted/stages/design/trajectories/level_fit.h"
#include "oted/stages/design/trajectories/long_windows.h"
#include "oted/stages/design/trajectories/mirrored_values.h"
#include "oted/stages/design/trajectories/own_designs.h"
#include "oted/stages/design/trajectories/short_windows.h"
#include "oted/stages/design/trajectories/stretch_estimate.h"
#include "oted/stages/design/trajectories/suspects.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kPartIterations = 4;      // of the fit of short windows that goes on without what judges
constexpr int kFewestPartWindows = 16;  // where fewer are left it is made anew
constexpr int kValidationRows = 960;
constexpr int kCleanRows = 240;     // that say what the fit of logs without noise rests on
constexpr double kFarEnd = 0.95;    // of the range: an interval that goes so far is all of it
constexpr double kElsewhere = 0.5;  // in x: an eighth of the range
constexpr double kUntold = 0.9;     // of the prior's standard deviation, all else known
constexpr double kUnsettled = 2.0;  // times the standard deviation of the fit
constexpr double kTold = 4.0;       // nats that a value's nominal one would lose where it is told after all
constexpr double kAtPrior = 0.5;    // the prior's standard deviations about its mean, where what is not told ends
constexpr int kRowsPerJudged = 3;   // of the last fit: what judges a fit needs it less exactly than who uses it
constexpr int kLongIterations = 20, kMostLongRows = 30000;
constexpr double kMostFinalPhysics = 8e5;  // steps of a linearization of them
constexpr int kLongSteps = kMostLongTries + 2 * kLongIterations;

/// The standard deviation of x whose 90 % interval goes from where it is, near an end of the range, to `end`: a share
/// of the range as seen from there.
double WidthTo(double end, double x) { return (std::log(end / (1 - end)) + std::abs(x)) / kEndOfInterval; }

/// How uncertain x is where its standard deviation `std` is a matter of derivatives, and z's range ends: u, the place
/// in the range, is then u(x) +- std du/dx, and x as wide as reaches the inner end of that. At a bound du/dx is next to
/// nothing, so std may be any number, and a Gaussian that wide would lie at both bounds.
/// @param most  the prior's: as much is never too wide
double WithinRange(double x, double std, double most) {
  const double u = LogitToUnit(-std::abs(x)), step = kEndOfInterval * std * u * (1 - u);
  const double end = std::min(u + step, kFarEnd);
  return std::min(std, std::max(WidthTo(end, x), most));
}

MatrixXd WithinRange(const Prior& prior, const VectorXd& x, const MatrixXd& covariance) {
  const VectorXd std = covariance.diagonal().cwiseSqrt(), most = prior.Std();
  VectorXd shrink(x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) shrink[i] = WithinRange(x[i], std[i], most[i]) / std[i];
  return shrink.asDiagonal() * covariance * shrink.asDiagonal();
}

/// The parameters that the logs do not tell, whatever the others are. One that they drove to a bound is none, though
/// derivatives say nothing there.
std::vector<int> Untold(const Prior& prior, const VectorXd& x, const MatrixXd& covariance) {
  const VectorXd alone = covariance.inverse().diagonal().cwiseInverse().cwiseSqrt(), of_prior = prior.Std();
  std::vector<int> untold;
  for (int i = 0; i < prior.size(); ++i) {
    const bool is_at_prior = std::abs(x[i] - prior.mean[i]) < kAtPrior * of_prior[i];
    if (is_at_prior && alone[i] > kUntold * of_prior[i]) untold.push_back(i);
  }
  return untold;
}

/// One run of the method, step by step.
class TrajectoryMatch {
 public:
  TrajectoryMatch(const ReplayProblem& problem, const TrajectoriesConfig& config)
      : problem_(problem),
        config_(config),
        space_(problem.factory.parameters()),
        scale_(ChannelScales(problem.dataset)),
        parts_(KeepAside(problem.dataset, problem.factory.spec().control_period_s, problem.kept_aside)),
        steps_(problem.progress, problem.context),
        short_(problem, config, kLongSteps, steps_, evidence_) {
    evidence_.scale = {scale_.begin(), scale_.end()};
  }

  ReplayFit Run() {
    bool explains_all = short_.Fit();
    const bool may_be_long = !explains_all || AreBriefAndNoisy();
    if (may_be_long) FitLongWindows(explains_all);
    if (!IsLong() && short_.IsNoisy()) {
      const VectorXd compared = short_.fit().x();
      const bool explains_more = short_.FitMoreRows();
      // On more rows a fit of brief windows may end far from what was compared, or show what few rows did not.
      const bool is_elsewhere = may_be_long && (short_.fit().x() - compared).cwiseAbs().maxCoeff() > kElsewhere;
      if (explains_all && (is_elsewhere || !explains_more)) FitLongWindows(explains_more);
      explains_all = explains_all && explains_more;
    }
    CountRows();
    if (problem_.judged && !AllLearn() && !of_part_) of_part_ = FitToPart();
    const bool explained = explains_all && !IsLong();
    MatrixXd covariance = explained ? fit().Finish() : fit().CovarianceOfParts() + SpreadOfAsGood();
    if (explained && problem_.judged) covariance = CheckedOnOwnLogs(covariance);
    covariance = WithinRange(problem_.prior, fit().x(), covariance);
    VectorXd x = fit().x();
    LeaveUntold(x, covariance);
    if (problem_.judged) {
      evidence_.unseen = FitUnseen();
      const Designer q(space_, x, covariance);
      evidence_.mirrored = FindMirrored(fit(), q);
      // Only a value that may be called identified is worth its conditions.
      if (!NarrowParameters(q).empty()) {
        RestsOn rests_on = WhatFitRestsOn(q);
        evidence_.conditions = std::move(rests_on.conditions);
        evidence_.asked = std::move(rests_on.asked);
        evidence_.asks_surely = rests_on.is_sure && short_.IsNoisy();
      }
    }
    steps_.Finish(x);
    return {.mean = x, .covariance = covariance, .evidence = evidence_};
  }

 private:
  /// Whether long windows took the place of the short ones.
  bool IsLong() const { return long_ != nullptr; }
  LevelFit& fit() { return IsLong() ? *long_ : short_.fit(); }

  void Descend(LevelFit& fit, int n_iterations) {
    fit.Descend(n_iterations, [&](const VectorXd& x) { steps_.Tell(x); });
  }

  /// Whether the windows so far are shorter than the first long ones, and noisy: so brief a window says little of what
  /// adds up, and less where it has to find rates as well.
  bool AreBriefAndNoisy() {
    const double seconds = evidence_.window * problem_.factory.spec().control_period_s;
    return short_.IsNoisy() && (seconds < kShortestLongWindow || !readings().unread.empty());
  }

  void CountRows() {
    evidence_.logged_rows = problem_.dataset.size();
    evidence_.rows = fit().n_rows();
  }

  /// Windows of tenths of a second, where they predict better.
  void FitLongWindows(bool explained) {
    steps_.Expect(kLongSteps);
    choice_ = ChooseLongWindows({.factory = problem_.factory,
                                 .parts = parts_,
                                 .prior = problem_.prior,
                                 .readings = readings(),
                                 .short_x = short_.fit().x(),
                                 .noise = short_.SensorNoise(),
                                 .short_steps = evidence_.window,
                                 .explained = explained},
                                problem_.context, [&](const VectorXd& x) { steps_.Tell(x); });
    if (choice_.n_steps == 0) return;
    const Level all = LongWindows(short_.replayer(), problem_.dataset, choice_.n_steps, FinalRows(),
                                  problem_.factory.spec().control_period_s);
    evidence_.window = choice_.n_steps;
    // The part that learns has fewer rows, and most of the way is in all of the logs the same.
    of_part_ = AllLearn() ? choice_.x : FitToPart();
    long_ = std::make_unique<LevelFit>(short_.replayer(), space_, problem_.prior, scale_, all, *of_part_);
    long_->LetErrorsGrow(short_.SensorNoise().cwiseAbs2());
    Descend(*long_, kLongIterations);
    long_->FinalCost();
    evidence_.errors_grow = true;
    evidence_.left_out = choice_.left_out;
  }

  /// Wider where designs from logs of this design's own come to rest elsewhere. They begin with its own starts. Where
  /// rates are unread, and each start may be another, that they rest near it therefore proves nothing.
  MatrixXd CheckedOnOwnLogs(const MatrixXd& covariance) {
    std::vector<VectorXd> off;
    const OwnDesigns own = DesignsFromOwnLogs(problem_, config_, short_, evidence_, covariance);
    for (const VectorXd& x : own.x) {
      off.push_back(Off(x, fit().x()));
      evidence_.own_logs.push_back(ToZ(space_, x));
    }
    const MatrixXd wider = own.are_near ? covariance : AsWideAs(off, own.times_fewer, covariance);
    const bool are_open = !off.empty() && !readings().unread.empty();
    for (int i = 0; i < space_.size(); ++i) {
      const bool is_wider = wider(i, i) > kUnsettled * kUnsettled * covariance(i, i);
      if (are_open || is_wider) evidence_.unsettled.push_back(i);
    }
    return wider;
  }

  /// What the logs do not tell stays at its nominal value, which the prior's mean is not where that is near an end of
  /// the range; it may be anything from there to the other end. A prior of the user's stays as it is. So does a value
  /// that nothing depends on but that the nominal one is worse than: friction below that of the floor.
  void LeaveUntold(VectorXd& x, MatrixXd& covariance) {
    const Prior of_nominal = ForTrajectories(Prior::Uniform(space_.size()), space_);
    const std::vector<double> nominal = ZToLogit(space_, space_.Nominal());
    for (const int i : Untold(problem_.prior, x, covariance)) {
      if (problem_.prior.mean[i] != of_nominal.mean[i]) continue;
      VectorXd left = x;
      left[i] = nominal[static_cast<size_t>(i)];
      // A value on its bound has no finite logit.
      if (std::abs(left[i]) >= kMaxX) left[i] = std::copysign(kFarthestX, left[i]);
      if (fit().NatsLostAt(left, x) > kTold) continue;
      x = left;
      if (of_part_) (*of_part_)[i] = x[i];
      if (std::abs(x[i]) <= std::abs(of_nominal.mean[i])) continue;
      const double width = WidthTo(kFarEnd, x[i]);
      covariance.row(i).setZero();
      covariance.col(i).setZero();
      covariance(i, i) = width * width;
    }
  }

  /// Mean square of how far the fits by other lengths of windows lie that predict as well: no length is the right one.
  MatrixXd SpreadOfAsGood() {
    MatrixXd square = MatrixXd::Zero(space_.size(), space_.size());
    for (const VectorXd& x : choice_.as_good) square += (x - fit().x()) * (x - fit().x()).transpose();
    return square / static_cast<double>(std::max<size_t>(1, choice_.as_good.size()));
  }

  /// What has not seen the logs that were kept aside.
  UnseenFit FitUnseen() {
    UnseenFit unseen{.z = {},
                     .computed = readings().computed,
                     .mean = {readings().mean.begin(), readings().mean.end()},
                     .std = {readings().std.begin(), readings().std.end()},
                     .covariance = {}};
    if (AllLearn()) return unseen;
    unseen.z = ToZ(space_, *of_part_);
    // The part has fewer rows than what the covariance is of.
    const double times_fewer = std::max(1.0, evidence_.rows / static_cast<double>(rows_of_part_));
    const MatrixXd covariance = times_fewer * fit().CovarianceOfNoise(LargestNoise(problem_.dataset));
    unseen.covariance.assign(covariance.data(), covariance.data() + covariance.size());
    return unseen;
  }

  RestsOn WhatFitRestsOn(const Designer& q) {
    const std::vector<ParameterSpec> specs = problem_.factory.Suspects();
    const std::unique_ptr<SimulatorFactory> wide = specs.empty() ? nullptr : problem_.factory.With(specs);
    if (wide == nullptr) return {};
    WindowReplayer wider = MakeReplayer(*wide, problem_.dataset, readings(), problem_.context.n_threads);
    // Each row of a log without noise tells all that any of them does.
    const bool is_clean = !short_.IsNoisy() && !IsLong();
    return FindConditions(specs, is_clean ? fit().Sampled(kCleanRows) : fit(), wider, problem_.prior, q);
  }

  /// Whether nothing could be kept aside.
  bool AllLearn() const { return parts_.judge.size() == problem_.dataset.size(); }

  /// x by the part of the logs that learns alone, settled as that by all of them.
  VectorXd FitToPart() {
    const bool is_long = choice_.n_steps > 0;
    rows_of_part_ = parts_.learn.size();
    if (!is_long && !short_.is_exact()) {
      if (std::optional<VectorXd> x = WithoutWhatJudges()) return *std::move(x);
    }
    WindowReplayer learner = MakeReplayer(problem_.factory, parts_.learn, readings(), problem_.context.n_threads);
    const double period = problem_.factory.spec().control_period_s;
    const int n_rows = is_long ? FinalRows() / kRowsPerJudged : kValidationRows;
    const int begins = is_long || short_.is_exact() ? evidence_.window : short_.shortest();
    const VectorXd from = is_long ? choice_.x : short_.fit().x();
    const VectorXd scale = ChannelScales(parts_.learn);
    const auto make = [&](Level level, VectorXd x) {
      auto fit = std::make_unique<LevelFit>(learner, space_, problem_.prior, scale, std::move(level), std::move(x));
      if (is_long) fit->LetErrorsGrow(short_.SensorNoise().cwiseAbs2());
      fit->HoldStarts(short_.is_exact());
      return fit;
    };
    const auto descend = [&](LevelFit& fit, bool) { Descend(fit, is_long ? kLongIterations : kPartIterations); };
    const std::unique_ptr<LevelFit> fit =
        FitGrowing(GrowingWindows(learner, parts_.learn, begins, evidence_.window, n_rows, period), from,
                   evidence_.window, 1, make, descend);
    if (fit == nullptr) return from;
    rows_of_part_ = fit->n_rows();
    return fit->x();
  }

  /// The fit of short windows, going on without those that hold a row that judges: their starts were found from windows
  /// half as long, and those of a fit that begins with noisy readings end in local minima. None where few are left.
  std::optional<VectorXd> WithoutWhatJudges() {
    std::vector<char> judges(static_cast<size_t>(problem_.dataset.size()), 1);
    for (const int row : parts_.learned_rows) judges[static_cast<size_t>(row)] = 0;
    std::vector<char> left_out;
    for (const LogWindow& window : short_.fit().level().windows) {
      const auto first = judges.begin() + window.begin;
      left_out.push_back(std::find(first, first + window.n_steps, 1) != first + window.n_steps ? 1 : 0);
    }
    if (std::ranges::count(left_out, 0) < kFewestPartWindows) return std::nullopt;
    LevelFit rest = short_.fit().LeavingOut(left_out);
    Descend(rest, kPartIterations);
    rest.FinalCost();
    rest.Finish();
    rows_of_part_ = rest.n_rows();
    return rest.x();
  }

  /// Of the last fit of long windows.
  int FinalRows() { return AffordableRows(kMostLongRows, kMostFinalPhysics, problem_.factory, readings()); }

  const ReadingModel& readings() { return short_.replayer().readings(); }

  const ReplayProblem& problem_;
  const TrajectoriesConfig& config_;
  const ParameterSpace& space_;
  VectorXd scale_;
  HeldOutParts parts_;
  FitEvidence evidence_;
  FitSteps steps_;
  ShortWindows short_;
  LongFitChoice choice_;
  std::unique_ptr<LevelFit> long_;   // null where the short windows stay
  std::optional<VectorXd> of_part_;  // x by the part that learns
  int rows_of_part_ = 1;             // that it rests on
};

}  // namespace

ReplayFit MatchTrajectories(const ReplayProblem& problem, const TrajectoriesConfig& config) {
  return TrajectoryMatch(problem, config).Run();
}

}  // namespace oted
