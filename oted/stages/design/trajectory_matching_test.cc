#include "oted/stages/design/trajectory_matching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted {
namespace {

constexpr size_t kGain = 0, kDamping = 1, kIdle = 2;
const std::vector<double> kTruth = {1.5, 0.6, 0.5};

ReplayFit Match(const Dataset& logs, uint64_t seed = 1, int n_threads = 1, const PointMassOptions& options = {}) {
  NullSink log;
  return MatchTrajectories(PointMassFactory(options), logs, {.n_rows = 400, .n_coarse = 16, .n_starts = 2},
                           RngKey(seed), [](int, int, const Eigen::VectorXd&) {},
                           {.log = &log, .n_threads = n_threads});
}

std::vector<double> Z(const ReplayFit& fit) {
  return LogitToZ(PointMass::MakeParameters(), {fit.mean.data(), static_cast<size_t>(fit.mean.size())});
}

TEST(MatchTrajectories, IsExactOnCleanLogs) {
  const std::vector<double> z = Z(Match(PointMassLogs(kTruth, 8)));
  EXPECT_NEAR(z[kGain], 1.5, 1e-6);
  EXPECT_NEAR(z[kDamping], 0.6, 1e-6);
}

TEST(MatchTrajectories, FindsParametersAndNoiseWhereTheNoiseIsUnknown) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 20), 0.05, RngKey(3));
  const ReplayFit fit = Match(logs);
  EXPECT_NEAR(Z(fit)[kGain], 1.5, 0.03);
  EXPECT_NEAR(Z(fit)[kDamping], 0.6, 0.03);
  for (const double std : fit.evidence->noise_std) EXPECT_NEAR(std, 0.05, 0.01);
}

TEST(MatchTrajectories, WhatHasNoEffectStaysAtThePrior) {
  const ReplayFit fit = Match(WithSensorNoise(PointMassLogs(kTruth, 8), 0.02, RngKey(4)));
  EXPECT_NEAR(fit.mean[kIdle], 0, 0.05);
  EXPECT_NEAR(std::sqrt(fit.covariance(kIdle, kIdle)), Designer::kPriorStd, 0.05);
}

TEST(MatchTrajectories, NinetyPercentIntervalsHoldTheTruthInNineCasesOfTen) {
  constexpr int kCases = 60;
  int held[2] = {0, 0};
  for (int k = 0; k < kCases; ++k) {
    Rng rng = RngKey(11).Index(static_cast<uint64_t>(k)).MakeRng();
    const std::vector<double> truth = {rng.Uniform(0.5, 1.7), rng.Uniform(0.3, 0.9), 0.5};
    const ReplayFit fit = Match(WithSensorNoise(PointMassLogs(truth, 20), 0.05, RngKey(100 + static_cast<uint64_t>(k))),
                                static_cast<uint64_t>(k));
    const Designer q(PointMass::MakeParameters(), fit.mean, fit.covariance);
    const auto intervals = q.CentralInterval(0.9);
    for (size_t i : {kGain, kDamping}) held[i] += intervals[i].low <= truth[i] && truth[i] <= intervals[i].high;
  }
  // 54 of 60 are expected; five binomial standard deviations are 12. The same excitation serves all cases.
  for (const int n : held) {
    EXPECT_GE(n, 45);
  }
}

TEST(MatchTrajectories, GivesTheSameBytesAtAnyThreadCount) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 5), 0.02, RngKey(5));
  const ReplayFit one = Match(logs, 2, 1), two = Match(logs, 2, 2);
  EXPECT_EQ(one.mean, two.mean);
  EXPECT_EQ(one.covariance, two.covariance);
}

TEST(MatchTrajectories, LogsWhoseStatesCannotBeSetAreADataErrorWithTheRemedy) {
  const Dataset logs = PointMassLogs(kTruth, 5);
  EXPECT_THAT(MessageOf<DataError>([&] { Match(logs, 1, 1, {.velocity_clip = 0}); }),
              testing::HasSubstr("design.form=paper"));
}

}  // namespace
}  // namespace oted
