#include "oted/stages/design/trajectories/long_windows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <utility>

#include "oted/base/error.h"
#include "oted/matching/designer.h"
#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/first_level.h"
#include "oted/stages/design/trajectories/left_out.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::array<double, 4> kWindows = {kShortestLongWindow, 0.25, 0.5, 1.0};  // [s]
constexpr double kPredicted = 0.5;                                                 // [s]
constexpr int kFewestJudged = 3;
constexpr double kStretch = 1.0;  // [s]
constexpr int kMostRows = 10000;
constexpr double kMostPhysics = 4e5;   // steps of a linearization
constexpr int kFewestLongRows = 1000;  // however much they cost
constexpr int kMostShortRows = 960;
constexpr int kFitIterations = 6;
constexpr double kWorse = 2.0;     // standard errors
constexpr double kNoticed = 0.02;  // of a mean square
// Of the short windows; of the first length and of that which is judged from two starts, of the others from one.
static_assert(kMostLongTries ==
              (kFitIterations + kMostLeftOut * kStepsWithoutPart) * (1 + 2 + 2 + (kWindows.size() - 2)));

struct LongFit {
  int n_steps;  // 0: the short windows'
  VectorXd x;
  MatrixXd errors;  // of its predictions
};

bool IsSurelyWorse(const MatrixXd& errors, const MatrixXd& than) {
  const PredictionRatio ratio = ComparePredictions(errors, than);
  return ratio.log_ratio > kWorse * ratio.std;
}
bool IsSurelyWorse(const LongFit& fit, const LongFit& than) { return IsSurelyWorse(fit.errors, than.errors); }

LongFit Best(const std::vector<LongFit>& fits) {
  const LongFit* best = &fits.front();
  for (const LongFit& fit : fits) {
    if (ComparePredictions(fit.errors, best->errors).log_ratio < 0) best = &fit;
  }
  return *best;
}

}  // namespace

Level LongWindows(WindowReplayer& replayer, const Dataset& dataset, int n_steps, int n_rows, double period_s) {
  std::vector<LogWindow> all;
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin + replayer.n_past_actions(); i + n_steps <= episode.end; i += n_steps) {
      all.push_back({i, n_steps, episode.begin});
    }
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
    level.starts.push_back(replayer.Guess(window));
    level.stretch.push_back(stretch);
  }
  return level;
}

Level GrowingWindows(WindowReplayer& replayer, const Dataset& dataset, int shortest, int n_steps, int n_rows,
                     double period_s) {
  int whole = shortest;
  while (CanGrow(whole, n_steps)) whole *= 2;
  return Cut(replayer, LongWindows(replayer, dataset, whole, n_rows, period_s), shortest);
}

int AffordableRows(int wanted, double n_steps, const SimulatorFactory& factory, const ReadingModel& readings) {
  const SimulatorSpec& spec = factory.spec();
  const double n_lanes = 1.0 + factory.parameters().size() + readings.state_dim();
  const double per_row = n_lanes * spec.physics_steps * spec.step_weight;
  return std::min(wanted, std::max(kFewestLongRows, static_cast<int>(n_steps / per_row)));
}

bool TakesOver(const MatrixXd& of_long, const MatrixXd& of_short, const std::function<MatrixXd()>& of_nominal,
               bool explained) {
  const auto misleads = [&](const MatrixXd& nominal) {
    return ComparePredictions(of_short, nominal).log_ratio > 0 && ComparePredictions(of_long, nominal).log_ratio < 0;
  };
  if (!explained || misleads(of_nominal())) return !IsSurelyWorse(of_long, of_short);
  const PredictionRatio gain = ComparePredictions(of_short, of_long);
  return gain.log_ratio > kNoticed + kWorse * gain.std;
}

LongFitChoice ChooseLongWindows(const LongFitInputs& in, const RunContext& context,
                                const std::function<void(const VectorXd&)>& tell) {
  const ParameterSpace& space = in.factory.parameters();
  const double period = in.factory.spec().control_period_s;
  if (!(period > 0)) return {};
  WindowReplayer learner = MakeReplayer(in.factory, in.parts.learn, in.readings, context.n_threads);
  const LeftOutRecordings judge(
      {.factory = in.factory, .parts = in.parts, .readings = in.readings, .noise = in.noise, .predicted_s = kPredicted},
      context.n_threads);
  if (judge.n_windows() < kFewestJudged) return {};

  const int n_rows = AffordableRows(kMostRows, kMostPhysics, in.factory, in.readings);
  const VectorXd scale = ChannelScales(in.parts.learn);
  const auto errors_of = [&](const LevelFit& fit) { return judge.ErrorsOf(fit, [&] { tell(fit.x()); }); };
  // The short windows' parameters have seen the logs that judge: they count by what they predict, and by what fits
  // that have not seen them predict, whichever is worse.
  const Level short_level = LongWindows(learner, in.parts.learn, in.short_steps, kMostShortRows, period);
  MatrixXd of_short = judge.ErrorsAt(in.short_x);
  if (!short_level.windows.empty()) {
    LevelFit fit(learner, space, in.prior, scale, short_level, in.short_x);
    fit.Descend(kFitIterations, tell);
    const MatrixXd unseen = errors_of(fit);
    if (ComparePredictions(unseen, of_short).log_ratio > 0) of_short = unseen;
  }
  std::vector<LongFit> tried = {{0, in.short_x, of_short}};
  std::vector<LongFit> by_length;
  std::vector<VectorXd> from = {NominalStart(space), in.short_x};
  for (const double seconds : kWindows) {
    const int n_steps = static_cast<int>(std::lround(seconds / period));
    if (n_steps <= std::max(in.short_steps, in.readings.longest_age() + 1)) continue;
    const Level level = LongWindows(learner, in.parts.learn, n_steps, n_rows, period);
    if (level.windows.size() < 4) break;
    // The length that is judged is what the others have to be better than: it gets a start of its own.
    if (seconds == kPredicted && !by_length.empty()) from.push_back(NominalStart(space));
    std::vector<LongFit> fits;
    for (const VectorXd& start : from) {
      LevelFit fit(learner, space, in.prior, scale, level, start);
      fit.LetErrorsGrow(in.noise.cwiseAbs2());
      fit.Descend(kFitIterations, tell);
      fits.push_back({n_steps, fit.x(), errors_of(fit)});
    }
    std::ranges::move(fits, std::back_inserter(tried));
    by_length.push_back(Best({tried.end() - static_cast<ptrdiff_t>(fits.size()), tried.end()}));
    from = {Best(tried).x};
    // Brief windows that predict well at first say nothing of those as long as what is judged.
    if (seconds >= kPredicted && IsSurelyWorse(by_length.back(), Best(tried))) break;
  }
  std::optional<MatrixXd> nominal;
  const auto of_nominal = [&] {
    if (!nominal) nominal = judge.ErrorsAt(NominalStart(space));
    return *nominal;
  };
  LongFit choice = tried.front();
  if (!by_length.empty()) {
    // Recordings hardly tell some lengths apart: of those that no other surely beats, the nearest to what is judged.
    const LongFit best = Best(by_length);
    std::erase_if(by_length, [&](const LongFit& fit) { return IsSurelyWorse(fit, best); });
    const LongFit nearest = *std::ranges::min_element(
        by_length, {}, [&](const LongFit& fit) { return std::abs(std::log(fit.n_steps * period / kPredicted)); });
    if (TakesOver(nearest.errors, of_short, of_nominal, in.explained)) choice = nearest;
  }
  LongFitChoice chosen{choice.n_steps, choice.x};
  if (choice.n_steps > 0) chosen.left_out = judge.BesideNominal(choice.errors, of_nominal());
  for (LongFit& fit : tried) {
    if (!IsSurelyWorse(fit, choice)) chosen.as_good.push_back(std::move(fit.x));
  }
  return chosen;
}

}  // namespace oted
