#include "oted/stages/design/trajectories/short_windows.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "oted/matching/as_vector.h"
#include "oted/matching/designer.h"
#include "oted/stages/design/trajectories/distant_values.h"
#include "oted/stages/design/trajectories/own_logs.h"

namespace oted {
namespace {

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
constexpr int kFewestRows = 256;        // however much they cost
constexpr double kVisibleNoise = 1e-4;  // of a channel's spread: below is rounding
constexpr double kNearlyAll = 0.9;      // of the windows: no other start, and no length between, tells more
constexpr double kSameFit = 0.004;      // in x, a thousandth of the range
constexpr size_t kGrownWindows = 40;    // at most, of own logs
constexpr int kMostMoves = 6;           // of places, at one length

/// Windows of twice the length; the longest at once where the shorter ones told all but rounding.
Level NextLevel(const Level& level, bool is_known) {
  Level next = Joined(level);
  if (!is_known) return next;
  for (Level longer = Joined(next); !longer.windows.empty(); longer = Joined(longer)) next = longer;
  return next;
}

/// Of the noise from shorter windows to longer ones: the geometric mean over channels.
double Growth(const VectorXd& of_longer, const VectorXd& of_shorter) {
  return std::exp((of_longer.array() / of_shorter.array()).log().mean());
}

}  // namespace

ShortWindows::ShortWindows(const ReplayProblem& problem, const TrajectoriesConfig& config, int n_steps_behind,
                           FitSteps& steps, FitEvidence& evidence, const std::vector<char>& computed)
    : problem_(problem),
      config_(config),
      space_(problem.factory.parameters()),
      n_steps_behind_(n_steps_behind),
      steps_(steps),
      evidence_(evidence),
      scale_(ChannelScales(problem.dataset)),
      rng_(problem.key.MakeRng()) {
  Read(computed);
  steps_.Expect((1 + config.starts) * kStartIterations + StepsOfLevels(shortest_) +
                std::max(n_steps_behind, StepsOfLevels(shortest_)));
}

void ShortWindows::Read(const std::vector<char>& computed) {
  const Dataset& logs = problem_.dataset;
  const SimulatorSpec& spec = problem_.factory.spec();
  fit_.reset();
  replayer_ = std::make_unique<WindowReplayer>(
      MakeReplayer(problem_.factory, logs, ReadingModel::Of(spec, logs, computed), problem_.context.n_threads));
  shortest_ = longest_ = replayer_->readings().ShortestWindow();
  // Rates that are fitted as well take longer windows.
  const bool all_read = replayer_->readings().unread.empty() || !(spec.control_period_s > 0);
  const int bound =
      all_read ? config_.window : std::max(config_.window, static_cast<int>(kLongestUnread / spec.control_period_s));
  for (const Episode& episode : logs.Episodes()) {
    while (CanGrow(longest_, std::min(bound, episode.size()))) longest_ *= 2;
  }
  const int wanted = all_read ? config_.rows : std::max(config_.rows, kFewestStretches * longest_);
  const int n_rows = std::max(std::min(wanted, kFewestRows), static_cast<int>(wanted / spec.step_weight));
  first_ = FirstLevel(*replayer_, logs, longest_, shortest_, n_rows, rng_);
  if (first_.windows.empty()) ThrowNothingStartable(logs, spec, shortest_);
}

int ShortWindows::StepsOfLevels(int length) const {
  int n = kFirstLevelIterations + kRounds * kRoundIterations;
  for (; length < longest_; length *= 2) n += kLevelIterations + kRounds * kRoundIterations;
  return n;
}

void ShortWindows::Descend(LevelFit& fit, int n_iterations) {
  fit.Descend(n_iterations, [&](const VectorXd& x) { steps_.Tell(x); });
}

VectorXd ShortWindows::FindStart() {
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

bool ShortWindows::FitLengths(VectorXd x, bool again) {
  Level level = first_;
  while (!level.windows.empty()) {
    const bool is_first = fit_ == nullptr;
    auto fit = std::make_unique<LevelFit>(*replayer_, space_, problem_.prior, scale_, level, x);
    const int n_iterations = is_first && !again ? kFirstLevelIterations : kLevelIterations;
    const bool held = is_first && is_exact_;
    steps_.Expect(StepsOfLevels(level.windows.front().n_steps) +
                  (is_exact_ ? 0 : std::max(n_steps_behind_, StepsOfLevels(shortest_))));
    fit->HoldStarts(held);
    Descend(*fit, n_iterations);
    if (held) {
      fit->HoldStarts(false);
      Descend(*fit, kLevelIterations);
    }
    TryOtherStarts(*fit);
    MoveDistant(fit);
    const VectorXd noise = fit->noise_variance().cwiseSqrt();
    evidence_.long_noise_std = {noise.begin(), noise.end()};
    if (is_first) evidence_.short_noise_std = evidence_.long_noise_std;
    if (is_first && LeaveOutComputed()) {
      level = first_;
      x = fit->x();
      continue;
    }
    ExpectUnguessed(*fit);
    const double growth = Growth(noise, SensorNoise());
    if (growth > kTolerableGrowth && !IsRounding(noise)) {
      // Where shorter windows are exact and these ask for the same, more is left as some starts were not found.
      if (!IsNoisy()) return (fit->x() - x).cwiseAbs().maxCoeff() < kSameFit;
      return problem_.judged && fit_ != nullptr && growth < kTolerableGrowth * GrowthInOwnLogs(fit->level());
    }
    x = fit->x();
    evidence_.window = level.windows.front().n_steps;
    evidence_.explained = fit->ShareExplained();
    evidence_.noise_std = evidence_.long_noise_std;
    level = NextLevel(fit->level(), is_first && !IsNoisy() && fit->ShareExplained() > kNearlyAll);
    fit_ = std::move(fit);
  }
  return true;
}

void ShortWindows::TryOtherStarts(LevelFit& fit) {
  for (int round = 0; round < kRounds && fit.ShareExplained() < 1; ++round) {
    const bool found = fit.TryOtherStarts(rng_);
    if (round > 0 && !found) break;
    fit.CountExplainedAlone();
    bool settled = false;
    for (int i = 0; i < kRoundIterations && !settled; ++i) {
      settled = fit.Step();
      steps_.Tell(fit.x());
    }
  }
}

void ShortWindows::MoveDistant(std::unique_ptr<LevelFit>& fit) {
  double cost = fit->FinalCost();
  const auto move = [&](bool explained_alone) {
    const std::optional<VectorXd> x = WithDistantMoved(*fit, space_, explained_alone);
    if (!x) return false;
    auto moved = std::make_unique<LevelFit>(*replayer_, space_, problem_.prior, scale_, fit->level(), *x);
    Descend(*moved, kLevelIterations);
    TryOtherStarts(*moved);
    const double cost_there = moved->FinalCost();
    if (!(cost_there < cost)) return false;
    cost = cost_there;
    fit = std::move(moved);
    return true;
  };
  // From afar windows are less far off before they are explained; near by, those that are not say little.
  for (int k = 0; k < kMostMoves && (move(false) || move(true)); ++k) {
  }
}

double ShortWindows::GrowthInOwnLogs(const Level& longer) {
  const auto [known, is_new] = growth_in_own_logs_.try_emplace(longer.windows.front().n_steps);
  if (!is_new) return known->second;
  Level some;
  const size_t stride = (longer.windows.size() + kGrownWindows - 1) / kGrownWindows;
  for (size_t w = 0; w < longer.windows.size(); w += stride) {
    some.windows.push_back(longer.windows[w]);
    some.stretch.push_back(static_cast<int>(w));
  }
  const VectorXd noise = SensorNoise();
  const Dataset logs = OwnLogs(*replayer_, *fit_, ToZ(space_, fit_->x()), noise, Through::kAll, rng_);
  WindowReplayer of_own = MakeReplayer(problem_.factory, logs, readings(), problem_.context.n_threads);
  return known->second = GrowthOf(some, of_own);
}

double ShortWindows::GrowthOf(const Level& windows, WindowReplayer& replayer) {
  VectorXd first, last;
  const auto make = [&](Level level, VectorXd x) {
    return std::make_unique<LevelFit>(replayer, space_, problem_.prior, scale_, std::move(level), std::move(x));
  };
  const auto descend = [&](LevelFit& fit, bool is_first) {
    Descend(fit, kLevelIterations);
    TryOtherStarts(fit);
    fit.FinalCost();
    last = fit.noise_variance();
    if (is_first) first = last;
  };
  FitGrowing(Cut(replayer, windows, shortest_), fit_->x(), windows.windows.front().n_steps, 1, make, descend);
  return Growth(last.cwiseSqrt(), first.cwiseSqrt());
}

bool ShortWindows::LeaveOutComputed() {
  if (!IsNoisy() || std::ranges::any_of(replayer_->readings().computed, [](char c) { return c != 0; })) return false;
  const std::vector<char> computed = ReadingsLeftOut(problem_.factory.spec(), problem_.dataset, SensorNoise());
  if (std::ranges::none_of(computed, [](char c) { return c != 0; })) return false;
  Read(computed);
  return true;
}

void ShortWindows::ExpectUnguessed(const LevelFit& fit) {
  const ReadingModel& readings = replayer_->readings();
  if (readings.unread.empty()) return;
  const LevelFit::Spread spread = fit.OfUnread();
  for (int k = 0; k < readings.n_unread(); ++k) {
    if (readings.guessed[static_cast<size_t>(k)] == 0) replayer_->Expect(k, spread.mean[k], spread.std[k]);
  }
}

bool ShortWindows::IsRounding(const VectorXd& noise) const {
  return (noise.array() <= kVisibleNoise * scale_.array()).all();
}

bool ShortWindows::IsNoisy() const {
  return !IsRounding(AsVector(fit_ == nullptr ? evidence_.short_noise_std : evidence_.noise_std));
}

VectorXd ShortWindows::SensorNoise() const { return AsVector(evidence_.short_noise_std); }

bool ShortWindows::FitMoreRows() {
  const int n_lanes = 1 + space_.size() + replayer_->state_dim();
  const int n_rows = static_cast<int>(kManyReplays / n_lanes / problem_.factory.spec().step_weight);
  longest_ = evidence_.window;
  steps_.Expect(StepsOfLevels(shortest_));
  Level more = FirstLevel(*replayer_, problem_.dataset, longest_, shortest_, n_rows, rng_);
  if (more.windows.size() < first_.windows.size() * 5 / 4) return true;
  first_ = std::move(more);
  const VectorXd x = fit_->x();
  fit_.reset();
  return FitLengths(x, true);
}

}  // namespace oted
