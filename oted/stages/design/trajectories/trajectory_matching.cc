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
constexpr double kLongestPrediction = 1.0;  // [s]
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

/// How parameters fitted to one part of the logs predict the other.
/// @param choice  a fit of that part; where short windows were enough, where its descent begins
std::optional<HeldOutPrediction> Validate(const ReplayProblem& problem, const HeldOutParts& parts,
                                          const FitEvidence& evidence, const LongFitChoice& choice) {
  const SimulatorSpec& spec = problem.factory.spec();
  const ParameterSpace& space = problem.factory.parameters();
  const double period = spec.control_period_s;
  if (!(period > 0) || parts.judge.size() == problem.dataset.size()) return std::nullopt;
  const int obs_dim = spec.obs_dim();
  VectorXd x = choice.x;
  if (choice.n_steps == 0) {
    WindowReplayer learner(
        problem.factory.Make(WindowReplayer::LinearizationLanes(space.size(), obs_dim), problem.context.n_threads),
        parts.learn);
    const Level level = LongWindows(learner, parts.learn, evidence.window, kValidationRows, period);
    if (level.windows.empty()) return std::nullopt;
    const VectorXd scale = ChannelScales(parts.learn);
    LevelFit fit(learner, space, problem.prior, scale, level, x);
    Descend(fit, kLevelIterations, [&](const VectorXd&) { problem.context.ThrowIfStopped(); });
    x = fit.x();
  }
  WindowReplayer replayer(
      problem.factory.Make(WindowReplayer::LinearizationLanes(0, obs_dim), problem.context.n_threads), parts.judge);
  PredictionJudge judge(replayer, parts.judge, Eigen::Map<const VectorXd>(evidence.short_noise_std.data(), obs_dim),
                        static_cast<int>(std::lround(kLongestPrediction / period)), period);
  HeldOutPrediction prediction = PredictHeldOut(judge, space.Nominal(), ToZ(space, x), period);
  return prediction.horizons.empty() ? std::nullopt : std::optional(std::move(prediction));
}

}  // namespace

ReplayFit MatchTrajectories(const ReplayProblem& problem, const TrajectoriesConfig& config) {
  const auto& [factory, dataset, prior, key, progress, context] = problem;
  const ParameterSpace& space = factory.parameters();
  const int n_lanes = WindowReplayer::LinearizationLanes(space.size(), factory.spec().obs_dim());
  WindowReplayer replayer(factory.Make(n_lanes, context.n_threads), dataset);
  const VectorXd scale = ChannelScales(dataset);
  int longest = kFirstWindow;
  for (const Episode& episode : dataset.Episodes()) {
    while (longest * 2 <= std::min(config.window, episode.size())) longest *= 2;
  }
  Rng rng = key.MakeRng();
  const Level first = FirstLevel(replayer, dataset, longest, config.rows, rng);
  if (first.windows.empty()) ThrowNothingStartable(dataset, factory.spec(), kFirstWindow);
  int n_levels = 1;
  for (int length = kFirstWindow; length < longest; length *= 2) ++n_levels;
  const int n_total = config.starts * kStartIterations + kFirstLevelIterations + (n_levels - 1) * kLevelIterations +
                      n_levels * kRounds * kRoundIterations;
  int n_done = 0, n_planned = 0;
  const auto tell = [&](const VectorXd& x) {
    progress(++n_done, n_total, x);
    context.ThrowIfStopped();
  };

  // Where to start: the prior's draws that explain single steps best, and the nominal parameters.
  const Level few = Leading(first, 40), third = Leading(first, std::max<size_t>(40, first.windows.size() / 3));
  std::vector<std::pair<double, VectorXd>> candidates;
  const VectorXd nominal = NominalStart(space);
  for (int k = 0; k < config.coarse; ++k) {
    VectorXd x = nominal;
    if (k > 0) {
      for (double& coordinate : x) coordinate = rng.Normal();
      x = prior.mean + prior.factor * x;
    }
    candidates.emplace_back(CoarseCost(replayer, few, scale, ToZ(space, x)), x);
    context.ThrowIfStopped();
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  VectorXd x = candidates.front().second;
  double best = std::numeric_limits<double>::infinity();
  for (int s = 0; s < std::min(config.starts, config.coarse); ++s) {
    LevelFit fit(replayer, space, prior, scale, third, candidates[static_cast<size_t>(s)].second);
    n_planned += kStartIterations;
    Descend(fit, kStartIterations, tell);
    n_done = n_planned;
    const double cost = fit.FinalCost();
    if (cost < best) x = fit.x();
    best = std::min(best, cost);
  }

  // Longer and longer windows, while they are explained as well as the short ones.
  std::unique_ptr<LevelFit> longest_fit;
  FitEvidence evidence;
  evidence.scale = {scale.begin(), scale.end()};
  Level level = first;
  bool is_short = false;  // the simulator explains short windows alone
  while (!level.windows.empty()) {
    const bool is_first = longest_fit == nullptr;
    auto fit = std::make_unique<LevelFit>(replayer, space, prior, scale, level, x);
    const int n_iterations = is_first ? kFirstLevelIterations : kLevelIterations;
    n_planned += n_iterations + kRounds * kRoundIterations;
    Descend(*fit, n_iterations, tell);
    for (int round = 0; round < kRounds && fit->TryOtherStarts(rng); ++round) {
      fit->CountExplainedAlone();
      for (int i = 0; i < kRoundIterations; ++i) {
        fit->Step();
        tell(fit->x());
      }
    }
    n_done = n_planned;
    fit->FinalCost();
    const VectorXd noise = fit->noise_variance().cwiseSqrt();
    evidence.long_noise_std = {noise.begin(), noise.end()};
    if (is_first) evidence.short_noise_std = evidence.long_noise_std;
    const Eigen::Map<const VectorXd> first_noise(evidence.short_noise_std.data(), noise.size());
    const double growth = std::exp((noise.array() / first_noise.array()).log().mean());
    is_short = growth > kTolerableGrowth;
    if (is_short) break;
    x = fit->x();
    evidence.window = level.windows.front().n_steps;
    evidence.explained = fit->ShareExplained();
    evidence.noise_std = evidence.long_noise_std;
    level = fit->Joined();
    longest_fit = std::move(fit);
  }
  const Eigen::Map<const VectorXd> sensor_noise(evidence.short_noise_std.data(), scale.size());
  const HeldOutParts parts = HoldOut(dataset, key.Stage("held out"));
  LongFitChoice choice;
  if (is_short) {
    choice = ChooseLongWindows({.factory = factory,
                                .learn = parts.learn,
                                .judge = parts.judge,
                                .prior = prior,
                                .short_x = longest_fit->x(),
                                .noise = sensor_noise,
                                .short_steps = evidence.window},
                               context, tell);
  }
  if (choice.n_steps > 0) {
    const Level all = LongWindows(replayer, dataset, choice.n_steps, kMostLongRows, factory.spec().control_period_s);
    longest_fit = std::make_unique<LevelFit>(replayer, space, prior, scale, all, choice.x);
    longest_fit->LetErrorsGrow(sensor_noise.cwiseAbs2());
    Descend(*longest_fit, kLongIterations, tell);
    longest_fit->FinalCost();
    evidence.window = choice.n_steps;
  } else {
    choice.x = longest_fit->x();
  }
  const MatrixXd covariance = longest_fit->Finish();
  evidence.suspects = FindSuspects(factory, dataset, *longest_fit, prior, context.n_threads);
  evidence.held_out = Validate(problem, parts, evidence, choice);
  progress(n_total, n_total, longest_fit->x());
  return {.mean = longest_fit->x(), .covariance = covariance, .evidence = evidence};
}

}  // namespace oted
