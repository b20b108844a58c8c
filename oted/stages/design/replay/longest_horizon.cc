#include "oted/stages/design/replay/longest_horizon.h"

#include <array>
#include <cmath>

#include "oted/matching/verdict.h"
#include "oted/stages/design/replay/judged_part.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {
namespace {

constexpr std::array<double, 4> kLongHorizons = {20, 10, 5, 2};  // [s]
constexpr size_t kMostLong = 8;                                  // windows
constexpr double kFollowsBelow = 0.5;                            // of a guess's error

/// Where windows of so many rows begin, back to back in each episode.
std::vector<int> BackToBack(WindowReplayer& replayer, const Dataset& logs, int length) {
  std::vector<int> rows;
  for (const Episode& episode : logs.Episodes()) {
    for (int row = episode.begin + replayer.n_past_actions(); row + length <= episode.end; row += length) {
      if (rows.size() < kMostLong && replayer.CanStart({row, length, episode.begin})) rows.push_back(row);
    }
  }
  return rows;
}

/// Whether a simulator is followed over the horizon: no channel is no better than a guess, and on average they are far
/// better. One joint that a servo holds says nothing of a load that swings.
/// @param error  its errors
bool IsFollowed(const HeldOutPrediction::Horizon& horizon, double HeldOutPrediction::Channel::*error) {
  double log_ratio = 0, n = 0;
  for (const HeldOutPrediction::Channel& c : horizon.channels) {
    if (!c.judged || !(c.guess > 0)) continue;
    if (IsNoBetterThanGuess(c.*error, c.guess)) return false;
    log_ratio += std::log(c.*error / c.guess);
    ++n;
  }
  return n > 0 && log_ratio < n * std::log(kFollowsBelow);
}

std::optional<HeldOutPrediction::Horizon> LongestIn(const PredictionProblem& problem, const Dataset& logs,
                                                    const std::vector<double>& other, int beyond) {
  const double period = problem.factory.spec().control_period_s;
  WindowReplayer replayer = MakeReplayer(problem.factory, logs, problem.readings, problem.n_threads);
  for (const double seconds : kLongHorizons) {
    const int n_steps = static_cast<int>(std::lround(seconds / period));
    if (n_steps <= beyond) break;
    const std::vector<int> rows = BackToBack(replayer, logs, LeadSteps(problem.readings, period) + n_steps);
    if (rows.empty()) continue;
    const JudgedPart part(problem, logs, rows, n_steps, period);
    const HeldOutPrediction::Horizon horizon =
        ErrorsOver(part.judge(), 0, n_steps * period, part.judge().Predict(problem.z).predicted[0],
                   part.PredictNearest(other).predicted[0]);
    if (IsFollowed(horizon, &HeldOutPrediction::Channel::designed) ||
        IsFollowed(horizon, &HeldOutPrediction::Channel::nominal)) {
      return horizon;
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<HeldOutPrediction::Horizon> LongestPredicted(const PredictionProblem& problem,
                                                           const std::vector<double>& other, int beyond) {
  if (!(problem.factory.spec().control_period_s > 0)) return std::nullopt;
  std::optional<HeldOutPrediction::Horizon> longest = LongestIn(problem, problem.kept_aside, other, beyond);
  const bool is_of_learned = !longest && problem.learned != nullptr;
  if (is_of_learned) longest = LongestIn(problem, *problem.learned, other, beyond);
  if (longest) longest->learned = is_of_learned || problem.JudgesByLearned();
  return longest;
}

}  // namespace oted
