#include "oted/stages/design/replay/prediction.h"

#include <algorithm>
#include <cmath>

#include "oted/stages/design/replay/replay_fit.h"
#include "oted/stages/design/trajectories/start_fit.h"

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kLead = 0.05;  // [s] of readings that tell a start state
constexpr int kFewestLead = 4;  // control steps
constexpr int kLeadIterations = 4;
constexpr double kLeadStep = 1e-5;  // of forward differences, in standard deviations of the channel
constexpr int kMostJudged = 200;    // windows

}  // namespace

PredictionJudge::PredictionJudge(WindowReplayer& replayer, const Dataset& logs, const VectorXd& noise, int n_steps,
                                 double period_s)
    : replayer_(replayer),
      variance_(noise.cwiseAbs2()),
      spread_(ChannelScales(logs)),
      start_step_(kLeadStep * spread_),
      n_lead_(std::max(kFewestLead, static_cast<int>(std::lround(kLead / period_s)))) {
  int longest = 0;
  for (const Episode& episode : logs.Episodes()) longest = std::max(longest, episode.size());
  n_steps_ = std::min(n_steps, longest - n_lead_);
  if (n_steps_ < 1) return;
  std::vector<LogWindow> all;
  for (const Episode& episode : logs.Episodes()) {
    for (int i = episode.begin; i + n_lead_ + n_steps_ <= episode.end; i += std::max(1, n_steps_ / 2)) {
      all.push_back({i, n_lead_, episode.begin});
    }
  }
  const size_t n = std::min<size_t>(all.size(), kMostJudged);
  for (size_t k = 0; k < n; ++k) {
    const LogWindow& window = all[k * all.size() / n];
    if (replayer.CanStart(window)) windows_.push_back(window);
  }
}

std::vector<VectorXd> PredictionJudge::Predict(const std::vector<double>& z) {
  const WindowLikelihood likelihood(variance_, n_lead_);
  const FittedStarts fitted = FitStarts(replayer_, LoggedStarts(replayer_, windows_),
                                        {.windows = windows_,
                                         .z = z,
                                         .likelihood = likelihood,
                                         .start_step = start_step_,
                                         .n_iterations = kLeadIterations});
  std::vector<LogWindow> whole = windows_;
  for (LogWindow& window : whole) window.n_steps = n_lead_ + n_steps_;
  std::vector<VectorXd> residuals = replayer_.Residuals(whole, fitted.starts, z);
  for (VectorXd& residual : residuals) {
    if (residual.size() > 0) residual = residual.tail(n_steps_ * variance_.size()).eval();
  }
  return residuals;
}

MatrixXd PredictionJudge::MeanSquares(const std::vector<double>& z) {
  const std::vector<VectorXd> residuals = Predict(z);
  MatrixXd squares(variance_.size(), static_cast<Eigen::Index>(residuals.size()));
  for (size_t w = 0; w < residuals.size(); ++w) {
    const auto column = static_cast<Eigen::Index>(w);
    squares.col(column) = spread_.cwiseAbs2();  // what is farther off is no nearer than a guess
    if (residuals[w].size() == 0 || !residuals[w].allFinite()) continue;
    const Eigen::Map<const MatrixXd> by_channel(residuals[w].data(), variance_.size(), n_steps_);
    squares.col(column) = (by_channel.cwiseAbs2().rowwise().mean() + variance_).cwiseMin(squares.col(column));
  }
  return squares;
}

std::vector<VectorXd> PredictionJudge::Rms(const std::vector<double>& z, const std::vector<int>& marks) {
  std::vector<VectorXd> sums(marks.size(), VectorXd::Zero(variance_.size()));
  double n = 0;
  for (const VectorXd& residual : Predict(z)) {
    if (residual.size() == 0 || !residual.allFinite()) continue;
    const Eigen::Map<const MatrixXd> by_channel(residual.data(), variance_.size(), n_steps_);
    for (size_t k = 0; k < marks.size(); ++k) {
      sums[k] += by_channel.leftCols(marks[k]).cwiseAbs2().rowwise().mean();
    }
    ++n;
  }
  for (VectorXd& sum : sums) sum = (sum / n).cwiseSqrt();
  return sums;
}

HeldOutPrediction PredictHeldOut(PredictionJudge& judge, const std::vector<double>& nominal,
                                 const std::vector<double>& designed, double period_s) {
  HeldOutPrediction prediction;
  prediction.n_windows = judge.n_windows();
  if (judge.n_windows() == 0) return prediction;
  std::vector<int> marks;
  for (const double seconds : {0.1, 0.5, 1.0}) {
    const int steps = static_cast<int>(std::lround(seconds / period_s));
    if (steps >= 1 && steps <= judge.n_steps()) marks.push_back(steps);
  }
  if (marks.empty()) marks.push_back(judge.n_steps());
  const std::vector<VectorXd> of_nominal = judge.Rms(nominal, marks), of_designed = judge.Rms(designed, marks);
  for (size_t k = 0; k < marks.size(); ++k) {
    prediction.horizons.push_back({marks[k] * period_s,
                                   {of_nominal[k].begin(), of_nominal[k].end()},
                                   {of_designed[k].begin(), of_designed[k].end()}});
  }
  return prediction;
}

}  // namespace oted
