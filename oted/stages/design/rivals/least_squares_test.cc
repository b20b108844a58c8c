#include "oted/stages/design/rivals/least_squares.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::least_squares_test {

constexpr size_t kGain = 0, kDamping = 1;
constexpr int kIdle = 2;
const std::vector<double> kTruth = {1.5, 0.6, 0.5};

ReplayFit Fit(const Dataset& logs, const LeastSquaresConfig& config = {}, int n_threads = 1,
              const PointMassOptions& task = {}) {
  NullSink log;
  const RunContext context{.log = &log, .n_threads = n_threads};
  return FitLeastSquares(
      {PointMassFactory(task), logs, Prior::Uniform(3), RngKey(1), [](int, int, const Eigen::VectorXd&) {}, context},
      config);
}

std::vector<double> Z(const ReplayFit& fit) { return ToZ(PointMass::MakeParameters(), fit.mean); }

TEST(FitLeastSquares, FindsTheTruthOfCleanLogsToAMillionth) {
  for (const int horizon : {1, 5, 20}) {
    const std::vector<double> z = Z(Fit(PointMassLogs(kTruth, 8), {.horizon = horizon}));
    EXPECT_NEAR(z[kGain], 1.5, 1e-6) << horizon;
    EXPECT_NEAR(z[kDamping], 0.6, 1e-6) << horizon;
  }
}

// q keeps |x| <= 6: a quarter of a percent of the range from the bound.
TEST(FitLeastSquares, ATruthOnABoundIsReached) {
  const std::vector<double> z = Z(Fit(PointMassLogs({2.0, 0.2, 0.5}, 8)));
  EXPECT_NEAR(z[kGain], 2.0, 0.0025 * 1.8);
  EXPECT_NEAR(z[kDamping], 0.2, 0.0025 * 0.8);
}

TEST(FitLeastSquares, WhatHasNoEffectIsAsWideAsThePrior) {
  const ReplayFit fit = Fit(PointMassLogs(kTruth, 8));
  EXPECT_NEAR(std::sqrt(fit.covariance(kIdle, kIdle)), Designer::kPriorStd, 1e-6);
}

TEST(FitLeastSquares, AGaussianPriorAndItsEstimateAddUpAsTwoGaussiansDo) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 8), 0.05, RngKey(5));
  const Prior prior = Prior::Gaussian(Eigen::Vector3d(-1, 0, 1.5), 0.01 * Eigen::Matrix3d::Identity());
  const ReplayFit alone = Fit(logs);
  NullSink log;
  const ReplayFit under = FitLeastSquares(
      {PointMassFactory(), logs, prior, RngKey(1), [](int, int, const Eigen::VectorXd&) {}, {.log = &log}}, {});
  const Eigen::Matrix3d of_logs =
      alone.covariance.inverse() - Eigen::Matrix3d::Identity() / (Designer::kPriorStd * Designer::kPriorStd);
  const Eigen::Matrix3d precision = of_logs + prior.precision;
  const Eigen::Vector3d expected = precision.ldlt().solve(of_logs * alone.mean + prior.precision * prior.mean);
  EXPECT_LT((under.mean - expected).norm(), 1e-6);
  EXPECT_LT((under.covariance - Eigen::Matrix3d(precision.inverse())).norm(), 1e-6);
  EXPECT_GT((under.mean - alone.mean).norm(), 0.1);
}

// One-step predictions of v' = (1 - d) v + g a from v + noise are a regression with an error in its regressor: the
// coefficient of v shrinks by var(v) / (var(v) + noise^2), whatever the amount of data. Here with the position's
// equation x' - x = 0.1 v' given no weight by its scale.
TEST(FitLeastSquares, NoiseInTheStartsBiasesItAsErrorsInVariablesDo) {
  const double noise = 0.5;
  const Dataset clean = PointMassLogs(kTruth, 400), logs = WithSensorNoise(clean, noise, RngKey(5));
  double velocity_variance = 0;
  for (int i = 0; i < clean.size(); ++i) velocity_variance += std::pow(clean.observations(i, 1), 2) / clean.size();
  const double shrunk = 0.4 * velocity_variance / (velocity_variance + noise * noise);
  const std::vector<double> z = Z(Fit(logs, {.horizon = 1, .rows = 8000, .starts = 2}));
  EXPECT_NEAR(1 - z[kDamping], shrunk, 0.02);
  EXPECT_GT(0.4 - shrunk, 0.08) << "the bias is there to be seen";
}

TEST(FitLeastSquares, TheCovarianceIsThatOfALinearRegression) {
  // Noise in s' alone: the starts are exact, residuals independent, and Gauss and Newton's covariance right.
  Dataset logs = PointMassLogs(kTruth, 40);
  Rng rng(3);
  double information = 0, mean = 0, variance = 0;
  for (int i = 0; i < logs.size(); ++i) mean += logs.observations(i, 1) / logs.size();
  for (int i = 0; i < logs.size(); ++i) variance += std::pow(logs.observations(i, 1) - mean, 2) / logs.size();
  double position_mean = 0, position_variance = 0;
  for (int i = 0; i < logs.size(); ++i) position_mean += logs.observations(i, 0) / logs.size();
  for (int i = 0; i < logs.size(); ++i)
    position_variance += std::pow(logs.observations(i, 0) - position_mean, 2) / logs.size();
  for (int i = 0; i < logs.size(); ++i) {
    // dx'/dgain = 0.1 a, dv'/dgain = a; noise of a hundredth of each scale.
    const double a = logs.actions(i, 0);
    information += a * a * (0.01 / position_variance + 1 / variance) / 1e-4;
    logs.next_observations(i, 0) += 0.01 * std::sqrt(position_variance) * rng.Normal();
    logs.next_observations(i, 1) += 0.01 * std::sqrt(variance) * rng.Normal();
  }
  const ReplayFit fit = Fit(logs, {.horizon = 1});
  const Designer q(PointMass::MakeParameters(), fit.mean, fit.covariance);
  // The actions are uncorrelated with the velocity before them, nearly.
  EXPECT_NEAR(q.Std()[kGain] * std::sqrt(information), 1, 0.1);
}

TEST(FitLeastSquares, GivesTheSameBytesAtAnyThreadCount) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 5), 0.02, RngKey(5));
  const ReplayFit one = Fit(logs, {}, 1), two = Fit(logs, {}, 2);
  EXPECT_EQ(one.mean, two.mean);
  EXPECT_EQ(one.covariance, two.covariance);
}

TEST(FitLeastSquares, LogsWhoseStatesCannotBeSetAreADataErrorWithTheRemedy) {
  EXPECT_THAT(MessageOf<DataError>([] { Fit(PointMassLogs(kTruth, 5), {}, 1, {.velocity_clip = 0}); }),
              testing::HasSubstr("design.method=paper"));
}

}  // namespace oted::least_squares_test
