#include "oted/stages/design/replay/noise_estimate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/rng.h"

namespace oted::noise_estimate_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kChannels = 2, kObservations = 3;
const VectorXd kSmallest = VectorXd::Constant(kChannels, 1e-16);

/// Windows of a linear plant (position, velocity) with a noise of its own on each, whose starts were fitted by weighted
/// least squares under the variances `believed`.
std::vector<FittedWindow> Windows(const VectorXd& noise_std, const VectorXd& believed, int n) {
  Rng rng(7);
  std::vector<FittedWindow> windows;
  for (int w = 0; w < n; ++w) {
    MatrixXd d_start(kChannels * kObservations, kChannels);
    VectorXd noise(d_start.rows()), precision(d_start.rows());
    for (int t = 0; t < kObservations; ++t) {
      d_start.middleRows(kChannels * t, kChannels) << 1, 0.1 * t, -0.5 * t, 1 - 0.1 * t;
      for (int c = 0; c < kChannels; ++c) {
        noise[kChannels * t + c] = noise_std[c] * rng.Normal();
        precision[kChannels * t + c] = 1 / believed[c];
      }
    }
    const MatrixXd weighted = precision.asDiagonal() * d_start;
    const VectorXd start = (d_start.transpose() * weighted).ldlt().solve(weighted.transpose() * noise);
    windows.push_back({noise - d_start * start, d_start});
  }
  return windows;
}

VectorXd Vector(double a, double b) { return (VectorXd(2) << a, b).finished(); }

TEST(NoiseVariance, TellsTheNoiseOfEveryChannelFromWindowsThatAreWeighedRightly) {
  const VectorXd noise = Vector(0.02, 0.5), truth = noise.cwiseAbs2();
  const VectorXd found =
      NoiseVariance(ReadingModel::Plain(2), Windows(noise, truth, 4000), truth, kSmallest).cwiseSqrt();
  EXPECT_NEAR(found[0] / 0.02, 1, 0.05);
  EXPECT_NEAR(found[1] / 0.5, 1, 0.05);
}

/// What prediction_evidence.cc takes it for: 5.44 over the number of readings that starts leave free.
TEST(NoiseVariance, ScattersAsAMedianOfSoManySquaresDoes) {
  constexpr int kLogs = 400, kReadings = 300;
  const VectorXd truth = VectorXd::Ones(1);
  Rng rng(3);
  double sum = 0, of_squares = 0;
  for (int log = 0; log < kLogs; ++log) {
    std::vector<FittedWindow> windows;
    for (int w = 0; w < kReadings / 3; ++w) {
      VectorXd residual(3);
      for (double& r : residual) r = rng.Normal();
      windows.push_back({residual, MatrixXd(3, 0)});
    }
    const double found =
        std::log(NoiseVariance(ReadingModel::Plain(1), windows, truth, VectorXd::Constant(1, 1e-16))[0]);
    sum += found;
    of_squares += found * found;
  }
  const double mean = sum / kLogs;
  EXPECT_NEAR((of_squares / kLogs - mean * mean) * kReadings, 5.44, 1.2);
}

// Fit and estimate in turn, from a guess that is off by a factor of 25 in either direction.
TEST(NoiseVariance, ComesToTheTruthFromAWrongGuessWithoutAChannelThatCollapses) {
  for (const VectorXd& guess : {Vector(0.5, 0.02), Vector(0.02, 0.02), Vector(0.5, 0.5)}) {
    VectorXd believed = guess.cwiseAbs2();
    for (int i = 0; i < 15; ++i)
      believed = NoiseVariance(ReadingModel::Plain(2), Windows(Vector(0.02, 0.5), believed, 2000), believed, kSmallest);
    EXPECT_NEAR(std::sqrt(believed[0]) / 0.02, 1, 0.07);
    EXPECT_NEAR(std::sqrt(believed[1]) / 0.5, 1, 0.07);
  }
}

TEST(NoiseVariance, AFifthOfTheWindowsGoneWrongMovesItLittle) {
  const VectorXd noise = Vector(0.02, 0.5), truth = noise.cwiseAbs2();
  std::vector<FittedWindow> windows = Windows(noise, truth, 2000);
  for (size_t w = 0; w < windows.size(); w += 5) windows[w].residual *= 100;
  const VectorXd found = NoiseVariance(ReadingModel::Plain(2), windows, truth, kSmallest).cwiseSqrt();
  EXPECT_LT(found[0] / 0.02, 1.5);
  EXPECT_LT(found[1] / 0.5, 1.5);
}

TEST(NoiseVariance, OfResidualsThatAreRoundingIsThatOfRounding) {
  const VectorXd truth = Vector(1e-9, 1e-9).cwiseAbs2();
  EXPECT_EQ(NoiseVariance(ReadingModel::Plain(2), Windows(Vector(1e-9, 1e-9), truth, 50), truth, kSmallest), kSmallest);
}

// A contact sensor that is zero most of the time: the readings that are not tell its noise.
TEST(NoiseVariance, AChannelThatRarelyShowsAnythingDoesNotCountAsNoiseless) {
  const VectorXd noise = Vector(0.02, 0.5), truth = noise.cwiseAbs2();
  std::vector<FittedWindow> windows = Windows(noise, truth, 2000);
  for (size_t w = 0; w < windows.size(); ++w) {
    for (int t = 0; w % 4 > 0 && t < kObservations; ++t) windows[w].residual[kChannels * t + 1] = 0;
  }
  EXPECT_NEAR(std::sqrt(NoiseVariance(ReadingModel::Plain(2), windows, truth, kSmallest)[1]) / 0.5, 1, 0.1);
}

/// Windows of 21 readings of one channel whose errors are autoregressive, `kept` of each going on into the next.
std::vector<FittedWindow> Autoregressive(double kept, int n) {
  Rng rng(3);
  std::vector<FittedWindow> windows;
  for (int w = 0; w < n; ++w) {
    VectorXd errors(21);
    errors[0] = rng.Normal();
    for (Eigen::Index t = 1; t < errors.size(); ++t) {
      errors[t] = kept * errors[t - 1] + std::sqrt(1 - kept * kept) * rng.Normal();
    }
    windows.push_back({errors, MatrixXd()});
  }
  return windows;
}

TEST(CorrelationTime, IsThatOfAnAutoregressiveSeries) {
  const VectorXd ones = VectorXd::Ones(21);
  EXPECT_NEAR(CorrelationTime(Autoregressive(0, 2000), ones, 1), 1, 0.05);
  double wanted = 1;  // up to the lag that correlates by a twentieth
  for (int lag = 1; lag <= 5; ++lag) wanted += 2 * (1 - lag / 21.0) * std::pow(0.6, lag);
  EXPECT_NEAR(CorrelationTime(Autoregressive(0.6, 2000), ones, 1), wanted, 0.1);
}

TEST(CorrelationTime, OfErrorsThatLastIsTheLengthOfTheWindowAndOfEachChannelTheMean) {
  const VectorXd ones = VectorXd::Ones(21);
  EXPECT_NEAR(CorrelationTime(Autoregressive(1, 100), ones, 1), 21, 0.2);
  // Three channels: one that lasts, one of noise, one that is not held.
  std::vector<FittedWindow> windows = Autoregressive(1, 2000);
  const std::vector<FittedWindow> noise = Autoregressive(0, 2000);
  VectorXd weight = VectorXd::Ones(63);
  for (size_t w = 0; w < windows.size(); ++w) {
    VectorXd three(63);
    for (Eigen::Index t = 0; t < 21; ++t) three.segment(3 * t, 3) << windows[w].residual[t], noise[w].residual[t], 1e6;
    windows[w].residual = three;
  }
  for (Eigen::Index t = 0; t < 21; ++t) weight[3 * t + 2] = 0;
  EXPECT_NEAR(CorrelationTime(windows, weight, 3), (21 + 1) / 2.0, 0.2);
}

}  // namespace oted::noise_estimate_test
