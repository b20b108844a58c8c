#include "oted/stages/design/rivals/dropo.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::dropo_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr size_t kGain = 0, kDamping = 1;
const std::vector<double> kTruth = {1.5, 0.6, 0.5};

ReplayFit Fit(const Dataset& logs, const DropoConfig& config = {}, int n_threads = 1,
              const PointMassOptions& task = {}) {
  NullSink log;
  const RunContext context{.log = &log, .n_threads = n_threads};
  return FitDropo(
      {PointMassFactory(task), logs, Prior::Uniform(3), RngKey(1), [](int, int, const VectorXd&) {}, context}, config);
}

std::vector<double> Z(const ReplayFit& fit) { return ToZ(PointMass::MakeParameters(), fit.mean); }

// One step of a linear plant, v' = c + gain a and x' = x + 0.1 v': predictions lie on a line, and with epsilon on the
// diagonal the density is that of two independent coordinates, along the line and across it.
TEST(PredictionLogDensity, IsThatOfALinearPlantInClosedForm) {
  const double a = 0.7, c = 0.2, x = 0.4, epsilon = 0.03;
  const std::vector<double> gains = {1.1, 1.5, 1.2, 1.9};
  MatrixXd predictions(4, 2);
  double mean = 0, variance = 0;
  for (int k = 0; k < 4; ++k) {
    const double v = c + gains[static_cast<size_t>(k)] * a;
    predictions.row(k) << x + 0.1 * v, v;
    mean += gains[static_cast<size_t>(k)] / 4;
  }
  for (const double gain : gains) variance += (gain - mean) * (gain - mean) / 3;
  const VectorXd observed = (VectorXd(2) << 0.6, 1.0).finished();
  const double v = c + mean * a, length = std::sqrt(1 + 0.01);
  const double dx = observed[0] - (x + 0.1 * v), dv = observed[1] - v;
  const double along = (0.1 * dx + dv) / length, across = (dx - 0.1 * dv) / length;
  const double variance_along = variance * a * a * length * length + epsilon;
  const double expected = -0.5 * (along * along / variance_along + across * across / epsilon +
                                  std::log(variance_along * epsilon) + 2 * std::log(2 * std::numbers::pi));
  EXPECT_NEAR(PredictionLogDensity(predictions, observed, epsilon), expected, 1e-12);
}

TEST(PredictionLogDensity, IsHighestAtTheMeanAndKnowsNoOrderOfDraws) {
  MatrixXd predictions(3, 1), other(3, 1);
  predictions << 1, 2, 6;
  other << 6, 1, 2;
  const auto at = [&](const MatrixXd& p, double o) { return PredictionLogDensity(p, VectorXd::Constant(1, o), 1e-3); };
  EXPECT_GT(at(predictions, 3), at(predictions, 3.1));
  EXPECT_GT(at(predictions, 3), at(predictions, 2.9));
  EXPECT_NEAR(at(predictions, 1), at(other, 1), 1e-12);
}

TEST(FitDropo, FindsTheTruthOfCleanLogs) {
  const std::vector<double> z = Z(Fit(PointMassLogs(kTruth, 8)));
  EXPECT_NEAR(z[kGain], 1.5, 0.01);
  EXPECT_NEAR(z[kDamping], 0.6, 0.01);
}

// What DROPO is for, and what a point estimate cannot say: the gain is another one in each episode.
TEST(FitDropo, TheSpreadOfQIsThatOfTheTargetsParameters) {
  Dataset logs;
  Rng rng(4);
  for (int episode = 0; episode < 60; ++episode) logs.Append(PointMassLogs({rng.Uniform(1.0, 1.6), 0.6, 0.5}, 1));
  const ReplayFit fit = Fit(logs, {.transitions = 300, .samples = 30, .budget = 1500});
  const Designer q(PointMass::MakeParameters(), fit.mean, fit.covariance);
  EXPECT_NEAR(q.Mode()[kGain], 1.3, 0.06);
  // A uniform distribution's spread, for which the cut-off Gaussian stands at 0.88 of its own.
  EXPECT_NEAR(0.88 * q.Std()[kGain] / (0.6 / std::sqrt(12.0)), 1, 0.35);
  EXPECT_NEAR(q.Mode()[kDamping], 0.6, 0.03);
  EXPECT_LT(q.Std()[kDamping], 0.03) << "the damping is the same everywhere";
}

TEST(FitDropo, ALearnedEpsilonFindsTheTruthToo) {
  const std::vector<double> z = Z(Fit(PointMassLogs(kTruth, 8), {.epsilon = 1e-3, .learn_epsilon = true}));
  EXPECT_NEAR(z[kGain], 1.5, 0.02);
  EXPECT_NEAR(z[kDamping], 0.6, 0.02);
}

TEST(FitDropo, GivesTheSameBytesAtAnyThreadCount) {
  const Dataset logs = PointMassLogs(kTruth, 4);
  const ReplayFit one = Fit(logs, {.budget = 60}, 1), two = Fit(logs, {.budget = 60}, 2);
  EXPECT_EQ(one.mean, two.mean);
  EXPECT_EQ(one.covariance, two.covariance);
}

TEST(FitDropo, LogsWhoseStatesCannotBeSetAreADataErrorWithTheRemedy) {
  EXPECT_THAT(MessageOf<DataError>([] { Fit(PointMassLogs(kTruth, 5), {}, 1, {.velocity_clip = 0}); }),
              testing::HasSubstr("design.method=paper"));
}

}  // namespace oted::dropo_test
