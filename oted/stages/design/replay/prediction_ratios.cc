#include "oted/stages/design/replay/prediction_ratios.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace oted {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kBlocksOfWindows = 10;
constexpr double kUnknownError = 100.0;  // of a logarithm: one block says nothing of chance

/// By how much an error from so few degrees of freedom must be wider so that the normal's 99 % holds: Student's t over
/// the normal.
double Widening(Eigen::Index freedom) {
  constexpr std::array<double, kBlocksOfWindows - 1> kStudent = {31.82, 6.965, 4.541, 3.747, 3.365,
                                                                 3.143, 2.998, 2.896, 2.821};
  return freedom < 1 ? 1.0 : kStudent[static_cast<size_t>(freedom - 1)] / 2.326;
}

/// (rows, blocks) of (rows, windows).
MatrixXd BlockSums(const MatrixXd& of_windows) {
  const Eigen::Index n = of_windows.cols(), n_blocks = std::min<Eigen::Index>(n, kBlocksOfWindows);
  MatrixXd sums = MatrixXd::Zero(of_windows.rows(), n_blocks);
  for (Eigen::Index w = 0; w < n; ++w) sums.col(w * n_blocks / n) += of_windows.col(w);
  return sums;
}

/// Squares as HeldOutPrediction counts them.
MatrixXd Counted(const MatrixXd& squares, const VectorXd& spread) {
  const VectorXd most = spread.cwiseAbs2(), visible = kVisibleError * kVisibleError * most;
  MatrixXd counted = squares;
  for (Eigen::Index w = 0; w < squares.cols(); ++w) {
    counted.col(w) = (squares.col(w).hasNaN() ? most : squares.col(w).cwiseMin(most).eval()) + visible;
  }
  return counted;
}

/// (channels, n): logarithms of squares, the mean over several draws of each window.
MatrixXd MeanLogs(const MatrixXd& squares, Eigen::Index n, const VectorXd& spread) {
  const MatrixXd counted = Counted(squares, spread);
  MatrixXd logs = MatrixXd::Zero(squares.rows(), n);
  for (Eigen::Index i = 0; i < squares.cols(); ++i) logs.col(i % n) += counted.col(i).array().log().matrix();
  return logs * (static_cast<double>(n) / static_cast<double>(squares.cols()));
}

/// Behind the channels' numbers, their weighted mean.
MatrixXd WithMean(const MatrixXd& of_channels, const VectorXd& weight) {
  MatrixXd all(of_channels.rows() + 1, of_channels.cols());
  all << of_channels, weight.transpose() * of_channels;
  return all;
}

}  // namespace

PredictionRatios::PredictionRatios(VectorXd value, Eigen::Index n_blocks,
                                   const std::function<VectorXd(Eigen::Index)>& without)
    : value_(std::move(value)) {
  VectorXd square = VectorXd::Zero(value_.size());
  for (Eigen::Index k = 0; k < n_blocks; ++k) square += (without(k) - value_).cwiseAbs2();
  const double blocks = static_cast<double>(n_blocks);
  error_ = Widening(n_blocks - 1) * (square * (blocks - 1) / blocks).cwiseSqrt();
  if (n_blocks < 2) error_.setConstant(kUnknownError);
}

void PredictionRatios::Add(const VectorXd& errors, const VectorXd& weight) {
  VectorXd all(errors.size() + 1);
  all << errors, weight.cwiseProduct(errors).norm();
  error_ = (error_.cwiseAbs2() + all.cwiseAbs2()).cwiseSqrt();
}

PredictionRatios MeansOf(const MatrixXd& of_windows, const VectorXd& weight) {
  const MatrixXd all = WithMean(of_windows, weight);
  const MatrixXd sums = BlockSums(all), counts = BlockSums(MatrixXd::Ones(1, all.cols()));
  const VectorXd sum = sums.rowwise().sum();
  const double windows = static_cast<double>(all.cols());
  return {sum / windows, sums.cols(),
          [&](Eigen::Index k) -> VectorXd { return (sum - sums.col(k)) / (windows - counts(0, k)); }};
}

PredictionRatios TypicalRatios(const MatrixXd& a, const MatrixXd& b, Eigen::Index n, const JudgedChannels& channels) {
  return MeansOf(MeanLogs(a, n, channels.spread) - MeanLogs(b, n, channels.spread), channels.weight);
}

VectorXd LogRatios(const MatrixXd& a, const MatrixXd& b, Eigen::Index n, const JudgedChannels& channels) {
  return (MeanLogs(a, n, channels.spread) - MeanLogs(b, n, channels.spread)).transpose() * channels.weight;
}

VectorXd ScatterOfDraws(const std::vector<MatrixXd>& draws, const JudgedChannels& channels) {
  const auto n = static_cast<Eigen::Index>(draws.size());
  if (n < 3) return VectorXd::Zero(channels.weight.size() + 1);
  MatrixXd values(channels.weight.size() + 1, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const MatrixXd& draw = draws[static_cast<size_t>(k)];
    values.col(k) = WithMean(MeanLogs(draw, draw.cols(), channels.spread), channels.weight).rowwise().mean();
  }
  const double draws_more = static_cast<double>(n + 1) / static_cast<double>(n), freedom = static_cast<double>(n - 1);
  const VectorXd square = (values.colwise() - values.rowwise().mean()).cwiseAbs2().rowwise().sum() / freedom;
  return (draws_more * square).cwiseSqrt();
}

PredictionRatios RatiosOfSums(const MatrixXd& a, const MatrixXd& b, const JudgedChannels& channels) {
  const MatrixXd sums_a = BlockSums(Counted(a, channels.spread)), sums_b = BlockSums(Counted(b, channels.spread));
  const VectorXd sum_a = sums_a.rowwise().sum(), sum_b = sums_b.rowwise().sum();
  const auto log_ratios = [&](const VectorXd& x, const VectorXd& y) -> VectorXd {
    return WithMean((x.array() / y.array()).log().matrix(), channels.weight);
  };
  return {log_ratios(sum_a, sum_b), sums_a.cols(),
          [&](Eigen::Index k) { return log_ratios(sum_a - sums_a.col(k), sum_b - sums_b.col(k)); }};
}

}  // namespace oted
