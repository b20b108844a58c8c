#include "oted/stages/design/replay/window_likelihood.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/rng.h"

namespace oted::window_likelihood_test {

using Eigen::VectorXd;

constexpr int kSteps = 8;
const VectorXd kVariance = Eigen::Vector3d(0.01, 1.0, 25.0);

/// Noise `factor` times the known one, without the numbers that a fitted start takes: those of the first observation.
VectorXd Noise(double factor, Rng& rng) {
  VectorXd residual = VectorXd::Zero((kSteps + 1) * 3);
  for (int i = 3; i < residual.size(); ++i) residual[i] = factor * std::sqrt(kVariance[i % 3]) * rng.Normal();
  return residual;
}

TEST(WindowLikelihood, ExplainsWhatNoiseLeavesAndNotTwiceAsMuch) {
  const WindowLikelihood likelihood(ReadingModel::Plain(3), kVariance, kSteps);
  Rng rng = RngKey(1).MakeRng();
  int n_noise = 0, n_twice = 0;
  for (int k = 0; k < 1000; ++k) {
    n_noise += likelihood.Explains(Noise(1, rng));
    n_twice += likelihood.Explains(Noise(2, rng));
  }
  // Chi-squared of 24 exceeds its mean by three standard deviations in 0.6 % of cases; four times it stays below in 1.2
  // %.
  EXPECT_GE(n_noise, 985);
  EXPECT_LE(n_twice, 30);
}

TEST(WindowLikelihood, WeightIsTheSlopeOfTheCost) {
  const WindowLikelihood likelihood(ReadingModel::Plain(3), kVariance, kSteps);
  Rng rng = RngKey(2).MakeRng();
  for (const double factor : {0.1, 1.0, 5.0}) {
    const VectorXd residual = Noise(factor, rng);
    const double error = residual.cwiseAbs2().dot(likelihood.precision()), step = 1e-4;
    const double slope =
        (likelihood.Cost(residual * std::sqrt(1 + step)) - likelihood.Cost(residual)) / (step * error / 2);
    EXPECT_NEAR(slope, likelihood.Weight(residual), 1e-3 * slope);
  }
}

TEST(WindowLikelihood, ScaleIsThatOfTheReadingsThatAreHeldBehindTheStart) {
  ReadingModel readings = ReadingModel::Plain(3);
  EXPECT_NEAR(WindowLikelihood(readings, kVariance, kSteps).LogScale(), kSteps * 0.5 * std::log(0.01 * 1 * 25), 1e-12);
  readings.computed[2] = 1;  // left out: whatever its noise is, it makes nothing likelier
  EXPECT_NEAR(WindowLikelihood(readings, kVariance, kSteps).LogScale(), kSteps * 0.5 * std::log(0.01), 1e-12);
}

TEST(WindowLikelihood, AWindowThatBrokeDownIsWorseThanAnyOtherAndCountsNothing) {
  const WindowLikelihood likelihood(ReadingModel::Plain(3), kVariance, kSteps);
  const VectorXd far = VectorXd::Constant((kSteps + 1) * 3, 100.0);
  EXPECT_GT(likelihood.Cost({}), likelihood.Cost(far));
  EXPECT_EQ(likelihood.Weight({}), 0);
  EXPECT_FALSE(likelihood.Explains({}));
}

}  // namespace oted::window_likelihood_test
