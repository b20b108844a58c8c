#include "oted/stages/design/trajectories/long_windows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "oted/base/error.h"
#include "oted/matching/designer.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array<double, 4> kWindows = {kShortestLongWindow, 0.25, 0.5, 1.0};  // [s]
constexpr double kPredicted = 0.5;                                                 // [s]
constexpr int kFewestJudged = 3;
constexpr double kStretch = 1.0;  // [s]
constexpr int kMostRows = 10000;
constexpr int kFitIterations = 6;
constexpr double kWorse = 2.0;  // standard errors

/// How much farther `a` predicts off than `b`, the mean over channels of the log of the ratio of mean squares, and the
/// standard error of that (delete-one jackknife over windows).
struct Comparison {
  double mean = 0, error = 0;
};

Comparison Compare(const MatrixXd& a, const MatrixXd& b) {
  const double n = static_cast<double>(a.cols());
  const VectorXd sum_a = a.rowwise().sum(), sum_b = b.rowwise().sum();
  Comparison result{(sum_a.array() / sum_b.array()).log().mean(), 0};
  double square = 0;
  for (Eigen::Index w = 0; w < a.cols(); ++w) {
    const double without = ((sum_a - a.col(w)).array() / (sum_b - b.col(w)).array()).log().mean();
    square += (without - result.mean) * (without - result.mean);
  }
  result.error = std::sqrt(square * (n - 1) / n);
  return result;
}

}  // namespace

Level LongWindows(WindowReplayer& replayer, const Dataset& dataset, int n_steps, int n_rows, double period_s) {
  std::vector<LogWindow> all;
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin; i + n_steps <= episode.end; i += n_steps) all.push_back({i, n_steps, episode.begin});
  }
  const size_t n = std::min(all.size(), static_cast<size_t>(std::max(1, n_rows / n_steps)));
  const int per_stretch = std::max(1, static_cast<int>(std::lround(kStretch / period_s)));
  Level level;
  int last_episode = -1, last_second = -1, stretch = -1;
  for (size_t k = 0; k < n; ++k) {
    const LogWindow& window = all[k * all.size() / n];
    if (!replayer.CanStart(window)) continue;
    const int second = (window.begin - window.episode_begin) / per_stretch;
    if (window.episode_begin != last_episode || second != last_second) ++stretch;
    last_episode = window.episode_begin;
    last_second = second;
    level.windows.push_back(window);
    level.starts.push_back(replayer.Logged(window, 0));
    level.stretch.push_back(stretch);
  }
  return level;
}

LongFitChoice ChooseLongWindows(const LongFitInputs& in, const RunContext& context,
                                const std::function<void(const VectorXd&)>& tell) {
  const ParameterSpace& space = in.factory.parameters();
  const double period = in.factory.spec().control_period_s;
  if (!(period > 0)) return {};
  const int obs_dim = in.factory.spec().obs_dim();
  const auto make = [&](int n_parameters, const Dataset& logs) {
    return WindowReplayer(in.factory.Make(WindowReplayer::LinearizationLanes(n_parameters, obs_dim), context.n_threads),
                          logs);
  };
  WindowReplayer learner = make(space.size(), in.learn), other = make(0, in.judge);
  const auto steps_of = [&](double seconds) { return static_cast<int>(std::lround(seconds / period)); };
  PredictionJudge judge(other, in.judge, in.noise, steps_of(kPredicted), period);
  if (judge.n_windows() < kFewestJudged) return {};

  const VectorXd scale = ChannelScales(in.learn);
  const MatrixXd of_short = judge.MeanSquares(ToZ(space, in.short_x));
  MatrixXd best_errors = of_short;
  LongFitChoice choice{0, in.short_x};
  std::vector<VectorXd> from = {NominalStart(space), in.short_x};
  for (const double seconds : kWindows) {
    const int n_steps = steps_of(seconds);
    if (n_steps <= in.short_steps) continue;
    const Level level = LongWindows(learner, in.learn, n_steps, kMostRows, period);
    if (level.windows.size() < 4) break;
    bool worse = true;
    for (const VectorXd& start : from) {
      LevelFit fit(learner, space, in.prior, scale, level, start);
      fit.LetErrorsGrow(in.noise.cwiseAbs2());
      for (int i = 0; i < kFitIterations; ++i) {
        const bool settled = fit.Step();
        tell(fit.x());
        if (settled && i >= 2) break;
      }
      const MatrixXd errors = judge.MeanSquares(ToZ(space, fit.x()));
      const Comparison to_best = Compare(errors, best_errors);
      worse = worse && to_best.mean > kWorse * to_best.error;
      if (to_best.mean < 0) {
        best_errors = errors;
        choice = {n_steps, fit.x()};
      }
    }
    if (worse) break;
    from = {choice.n_steps > 0 ? choice.x : in.short_x};
  }
  // Other parameters than the short windows' for a reason that chance does not give.
  const Comparison gain = Compare(best_errors, of_short);
  if (!(gain.mean < -kWorse * gain.error)) return {};
  return choice;
}

}  // namespace oted
