#include "oted/stages/design/replay/judged_part.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "oted/base/statistics.h"
#include "oted/sim/channel_path.h"
#include "oted/stages/design/replay/prediction_ratios.h"
#include "oted/stages/design/replay/reading_model.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {
constexpr int kMostPredicted = 60;  // windows at each horizon

}  // namespace

JudgedPart::JudgedPart(const PredictionProblem& problem, const Dataset& logs, const std::vector<int>& horizons,
                       double period_s)
    : problem_(problem),
      logs_(logs),
      replayer_(Replayer(logs)),
      judge_(replayer_, logs, problem.noise, horizons, period_s, kMostPredicted) {}

JudgedPart::JudgedPart(const PredictionProblem& problem, const Dataset& logs, const std::vector<int>& rows, int n_steps,
                       double period_s)
    : problem_(problem),
      logs_(logs),
      replayer_(Replayer(logs)),
      judge_(replayer_, logs, problem.noise, rows, n_steps, period_s) {}

bool JudgedPart::IsPrompt(const std::vector<double>& z) const {
  const ParameterSpace& space = problem_.factory.parameters();
  bool any_lag = false;
  for (int i = 0; i < space.size(); ++i) {
    if (!IsChannelPath(space[i].field)) continue;
    if (ResolveChannel(problem_.factory.spec(), space[i].field).quantity != ChannelQuantity::kObservationDelay)
      continue;
    any_lag = true;
    if (z[static_cast<size_t>(i)] != 0) return false;
  }
  return any_lag;
}

PredictionJudge::Squares JudgedPart::PredictNearest(const std::vector<double>& z) const {
  PredictionJudge::Squares nearest = judge_.Predict(z);
  const auto take_nearer = [&](const PredictionJudge::Squares& other) {
    for (size_t h = 0; h < judge_.horizons().size(); ++h) {
      const PredictionRatios ratios = RatiosOfSums(other.predicted[h], nearest.predicted[h], judge_.channels());
      if (ratios.OfAll().value < 0) nearest.predicted[h] = other.predicted[h];
    }
  };
  // A start that is fitted by a wrong simulator can be worse than what the readings say.
  take_nearer(judge_.PredictFromReadings(z));
  if (!IsPrompt(z)) return nearest;
  SimulatorSpec prompt = problem_.factory.spec();
  prompt.reading_ages.clear();
  WindowReplayer replayer = MakeReplayer(
      problem_.factory, logs_, ReadingModel::Of(prompt, logs_, problem_.readings.computed), problem_.n_threads);
  const PredictionJudge judge(replayer, judge_);
  take_nearer(judge.Predict(z));
  take_nearer(judge.PredictFromReadings(z));
  return nearest;
}

std::optional<size_t> JudgedPart::Find(int n_steps, int fewest) const {
  const auto found = std::ranges::find(judge_.horizons(), n_steps);
  const auto h = static_cast<size_t>(found - judge_.horizons().begin());
  if (found == judge_.horizons().end() || judge_.n_windows(h) < fewest) return std::nullopt;
  return h;
}

PredictionJudge::Squares JudgedPart::PredictItself(const std::vector<double>& z, const std::vector<VectorXd>& followed,
                                                   const VectorXd& noise, Rng& rng) const {
  const Dataset made = judge_.Imitate(followed, noise, rng);
  WindowReplayer replayer = Replayer(made);
  return PredictionJudge(replayer, made, judge_).Predict(z);
}

WindowReplayer JudgedPart::Replayer(const Dataset& logs) const {
  return MakeReplayer(problem_.factory, logs, problem_.readings, problem_.n_threads);
}

Estimated IfJudged(const PredictionJudge& judge, size_t c, const PredictionRatios& ratios) {
  const auto row = static_cast<Eigen::Index>(c);
  return judge.channels().weight[row] > 0 ? ratios.OfChannel(row) : Estimated{};
}

HeldOutPrediction::Horizon ErrorsOver(const PredictionJudge& judge, size_t h, double seconds, const MatrixXd& designed,
                                      const MatrixXd& other) {
  const PredictionRatios gain = RatiosOfSums(other, designed, judge.channels());
  const VectorXd designed_rms = RootMeanSquares(designed), other_rms = RootMeanSquares(other), guess = judge.Guess(h);
  HeldOutPrediction::Horizon horizon;
  horizon.seconds = seconds;
  horizon.n_steps = judge.horizons()[h];
  horizon.n_windows = judge.n_windows(h);
  horizon.gain = gain.OfAll();
  horizon.typical_gain = TypicalRatios(other, designed, other.cols(), judge.channels()).OfAll();
  for (Eigen::Index c = 0; c < designed_rms.size(); ++c) {
    horizon.channels.push_back({.nominal = other_rms[c],
                                .designed = designed_rms[c],
                                .floor = 0,
                                .spread = judge.channels().spread[c],
                                .judged = judge.channels().weight[c] > 0,
                                .excess = {},
                                .gain = IfJudged(judge, static_cast<size_t>(c), gain),
                                .guess = guess[c]});
  }
  return horizon;
}

VectorXd RootMeanSquares(const MatrixXd& squares) {
  VectorXd sum = VectorXd::Zero(squares.rows());
  double n = 0;
  for (Eigen::Index w = 0; w < squares.cols(); ++w) {
    if (squares.col(w).hasNaN()) continue;
    sum += squares.col(w);
    ++n;
  }
  return (sum / n).cwiseSqrt();
}

MatrixXd Beside(const MatrixXd& a, const MatrixXd& b) {
  MatrixXd both(a.rows(), a.cols() + b.cols());
  both << a, b;
  return both;
}

MatrixXd AllBeside(const std::vector<MatrixXd>& draws) {
  MatrixXd all = draws.front();
  for (size_t k = 1; k < draws.size(); ++k) all = Beside(all, draws[k]);
  return all;
}

MatrixXd MeanOf(const std::vector<MatrixXd>& draws) {
  MatrixXd sum = draws.front();
  for (size_t k = 1; k < draws.size(); ++k) sum += draws[k];
  return sum / static_cast<double>(draws.size());
}

VectorXd Medians(const MatrixXd& squares) {
  VectorXd medians(squares.rows());
  for (Eigen::Index c = 0; c < squares.rows(); ++c) {
    std::vector<double> values;
    for (Eigen::Index w = 0; w < squares.cols(); ++w) {
      values.push_back(std::isnan(squares(c, w)) ? std::numeric_limits<double>::infinity() : squares(c, w));
    }
    medians[c] = Median(std::move(values));
  }
  return medians;
}

}  // namespace oted
