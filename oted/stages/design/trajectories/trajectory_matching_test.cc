#include "oted/stages/design/trajectories/trajectory_matching.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/matching/verdict.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/testing.h"

namespace oted::trajectory_matching_test {

constexpr size_t kGain = 0, kDamping = 1, kIdle = 2;
const std::vector<double> kTruth = {1.5, 0.6, 0.5};

ReplayFit MatchUnder(const Prior& prior, const Dataset& logs) {
  NullSink log;
  return MatchTrajectories(
      {PointMassFactory(), logs, prior, RngKey(1), [](int, int, const Eigen::VectorXd&) {}, {.log = &log}},
      {.rows = 400, .starts = 2, .coarse = 16});
}

ReplayFit Match(const Dataset& logs, const SimulatorFactory& factory, uint64_t seed, int n_threads = 1) {
  NullSink log;
  const Prior prior = Prior::Uniform(factory.parameters().size());
  const RunContext context{.log = &log, .n_threads = n_threads};
  return MatchTrajectories({factory, logs, prior, RngKey(seed), [](int, int, const Eigen::VectorXd&) {}, context},
                           {.rows = 400, .starts = 2, .coarse = 16});
}

ReplayFit Match(const Dataset& logs, uint64_t seed = 1, int n_threads = 1, const PointMassOptions& options = {}) {
  return Match(logs, PointMassFactory(options), seed, n_threads);
}

std::vector<double> Z(const ReplayFit& fit) {
  return LogitToZ(PointMass::MakeParameters(), {fit.mean.data(), static_cast<size_t>(fit.mean.size())});
}

TEST(MatchTrajectories, IsExactOnCleanLogs) {
  const std::vector<double> z = Z(Match(PointMassLogs(kTruth, 8)));
  EXPECT_NEAR(z[kGain], 1.5, 1e-6);
  EXPECT_NEAR(z[kDamping], 0.6, 1e-6);
}

/// A point mass whose idle parameter is friction: it takes from the velocity, and may be none.
class Rubbing : public PointMass {
 public:
  using PointMass::PointMass;
  void SetParameters(int lane, std::span<const double> z) override {
    PointMass::SetParameters(lane, std::vector<double>{std::max(0.2, z[0] * (1 - z[2])), z[1], z[2]});
  }
};
class RubbingFactory : public PointMassFactory {
 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<Rubbing>(PointMassOptions{}, n_lanes, n_threads);
  }
};

TEST(MatchTrajectories, WhatIsNothingIsFoundAndMovesNoOther) {
  // Gain times (1 - friction) is at the top of the gain's range: only no friction explains it.
  const Dataset logs = WithSensorNoise(PointMassLogs({1.999, 0.6, 0.5}, 20), 1e-4, RngKey(3));
  const std::vector<double> z = Z(Match(logs, RubbingFactory(), 1));
  EXPECT_LT(z[kIdle], 1e-3) << "a 400th of the range is 0.0025";
  EXPECT_NEAR(z[kDamping], 0.6, 1e-3);
}

TEST(MatchTrajectories, WhatTheLogsDoNotTellStaysNominalThoughThatIsAnEndOfItsRange) {
  // Nothing depends on idle, whose nominal value, 1, ends its range; a prior's mean cannot lie there.
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 20), 0.01, RngKey(3));
  const ParameterSpace space = PointMass::MakeParameters();
  const ReplayFit fit = MatchUnder(ForTrajectories(Prior::Uniform(3), space), logs);
  EXPECT_NEAR(Z(fit)[kIdle], 1, 1e-5);
  EXPECT_NEAR(Z(fit)[kGain], 1.5, 0.02);
  const SearchInterval interval = Designer(space, fit.mean, fit.covariance).CentralInterval(0.9)[kIdle];
  EXPECT_NEAR(interval.low, 0.05, 0.01) << "it may be anything";
  // What the logs drove to a bound is told, though derivatives vanish there.
  Dataset beyond = logs;
  for (double& action : beyond.actions.values()) action *= 0.5;
  EXPECT_GT(Z(MatchUnder(ForTrajectories(Prior::Uniform(3), space), beyond))[kGain], 1.97);
  // What the user believed is no nominal value.
  const ReplayFit believed = MatchUnder(Prior::Gaussian(Eigen::Vector3d(0, 0, -1), Eigen::Matrix3d::Identity()), logs);
  EXPECT_NEAR(believed.mean[kIdle], -1, 1e-3);
}

/// The point mass with an offset of the action where idle is near 1, its nominal value, and none below: nothing depends
/// on it on either side, as on the smaller one of two frictions.
constexpr double kEdge = 0.99;
class Offset : public PointMass {
 public:
  Offset(int n_lanes, int n_threads) : PointMass({}, n_lanes, n_threads), offset_(static_cast<size_t>(n_lanes)) {}
  void SetParameters(int lane, std::span<const double> z) override {
    PointMass::SetParameters(lane, z);
    offset_[static_cast<size_t>(lane)] = z[2] > kEdge ? 0.1 : 0;
  }
  void Step(std::span<const int> lanes, std::span<const double> actions) override {
    std::vector<double> moved(actions.begin(), actions.end());
    for (size_t k = 0; k < lanes.size(); ++k) moved[k] += offset_[static_cast<size_t>(lanes[k])];
    PointMass::Step(lanes, moved);
  }

 private:
  std::vector<double> offset_;
};
class OffsetFactory : public PointMassFactory {
 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<Offset>(n_lanes, n_threads);
  }
};

TEST(MatchTrajectories, AValueThatNothingDependsOnDoesNotGiveWayToAWorseNominalOne) {
  const Dataset logs = WithSensorNoise(PointMassLogs({1.5, 0.6, 0.3}, 20), 0.01, RngKey(3));
  const ParameterSpace space = PointMass::MakeParameters();
  NullSink log;
  const Prior prior = ForTrajectories(Prior::Uniform(3), space);
  const ReplayFit fit = MatchTrajectories(
      {OffsetFactory(), logs, prior, RngKey(1), [](int, int, const Eigen::VectorXd&) {}, {.log = &log}},
      {.rows = 400, .starts = 1, .coarse = 1});
  EXPECT_LT(Z(fit)[kIdle], kEdge);
  EXPECT_NEAR(Z(fit)[kGain], 1.5, 0.02);
  EXPECT_LT(fit.evidence->unseen->z[kIdle], kEdge) << "nor where a part of the logs learns";
}

TEST(MatchTrajectories, WhatLiesBeyondABoundIsThatBoundAndNotBoth) {
  // Actions logged at a half ask for twice the gain: 3.6, where the range ends at 2.
  Dataset logs = WithSensorNoise(PointMassLogs({1.8, 0.6, 0.5}, 20), 0.01, RngKey(3));
  for (double& action : logs.actions.values()) action *= 0.5;
  const ReplayFit fit = Match(logs);
  const Designer q(PointMass::MakeParameters(), fit.mean, fit.covariance);
  const Designer::Interval interval = q.CentralInterval(0.9)[kGain];
  EXPECT_GT(interval.low, 1.8);
  EXPECT_TRUE(EndsAtBound(q.space()[kGain], interval.low, interval.high));
  EXPECT_EQ(ParametersAtBounds(q), std::vector<int>{kGain});
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

TEST(MatchTrajectories, WhatHasNoEffectIsWhereAGaussianPriorPutsItAndWhatHasIsNotMovedByOne) {
  const Prior prior =
      Prior::Gaussian(Eigen::Vector3d(0, 0, 1.5), Eigen::Vector3d(0.3, 0.3, 0.2).cwiseAbs2().asDiagonal());
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 8), 0.02, RngKey(4));
  const ReplayFit under = MatchUnder(prior, logs), flat = Match(logs);
  EXPECT_NEAR(under.mean[kIdle], 1.5, 0.05);
  EXPECT_NEAR(std::sqrt(under.covariance(kIdle, kIdle)), 0.2, 0.02);
  // Logs and prior as two Gaussians: their precisions add up.
  const double logs_precision = 1 / flat.covariance(kGain, kGain) - 1 / (1.7 * 1.7), prior_precision = 1 / 0.09;
  const double expected = logs_precision * flat.mean[kGain] / (logs_precision + prior_precision);
  EXPECT_NEAR(under.mean[kGain], expected, 2 * std::sqrt(flat.covariance(kGain, kGain)));
  EXPECT_GT(under.mean[kGain], 0.5 * flat.mean[kGain]);
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
    EXPECT_TRUE(fit.evidence->own_logs.empty()) << "starts have no local minima";
  }
  // 54 of 60 are expected; five binomial standard deviations are 12. The same excitation serves all cases.
  for (const int n : held) {
    EXPECT_GE(n, 45);
  }
}

TEST(MatchTrajectories, IntervalsHoldTheTruthWhereContactMakesTheCostJump) {
  constexpr int kCases = 60;
  int held[2] = {0, 0};
  for (int k = 0; k < kCases; ++k) {
    Rng rng = RngKey(12).Index(static_cast<uint64_t>(k)).MakeRng();
    const std::vector<double> truth = {rng.Uniform(0.5, 1.7), rng.Uniform(0.3, 0.9), 0.5};
    BetweenWalls target(20, 1);
    const Dataset logs = WithSensorNoise(RandomLogs(target, truth), 0.05, RngKey(200 + static_cast<uint64_t>(k)));
    const ReplayFit fit = Match(logs, BetweenWallsFactory(), static_cast<uint64_t>(k));
    const auto intervals = Designer(PointMass::MakeParameters(), fit.mean, fit.covariance).CentralInterval(0.9);
    for (size_t i : {kGain, kDamping}) held[i] += intervals[i].low <= truth[i] && truth[i] <= intervals[i].high;
  }
  for (const int n : held) {
    EXPECT_GE(n, 45);
  }
}

/// The point mass whose gain is the product of its first parameter and, in place of idle, a gear of 0.5 + its third.
class Geared : public PointMass {
 public:
  using PointMass::PointMass;
  void SetParameters(int lane, std::span<const double> z) override {
    PointMass::SetParameters(lane, std::vector<double>{std::clamp(z[0] * (0.5 + z[2]), 0.2, 2.0), z[1], 0});
  }
};

class GearedFactory : public PointMassFactory {
 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<Geared>(PointMassOptions{}, n_lanes, n_threads);
  }
};

TEST(MatchTrajectories, OfTwoParametersThatMatterAsAProductNeitherIsIdentified) {
  for (uint64_t k = 0; k < 10; ++k) {
    Rng rng = RngKey(14).Index(k).MakeRng();
    const std::vector<double> truth = {rng.Uniform(0.6, 1.3), rng.Uniform(0.3, 0.9), rng.Uniform(0.2, 0.8)};
    Geared target({}, 20, 1);
    const Dataset logs = WithSensorNoise(RandomLogs(target, truth), 0.01, RngKey(300 + k));
    const ReplayFit fit = Match(logs, GearedFactory(), k);
    const Designer q(PointMass::MakeParameters(), fit.mean, fit.covariance);
    const auto summary = SummarizeParameters({q}, 0, {true, true, true}, true);
    EXPECT_NE(summary[kGain].verdict, ParameterVerdict::kIdentified) << k;
    EXPECT_NE(summary[kIdle].verdict, ParameterVerdict::kIdentified) << k;
    EXPECT_EQ(summary[kDamping].verdict, ParameterVerdict::kIdentified) << k;
    EXPECT_LT(q.Correlation()(kGain, kIdle), -0.8) << k;
    EXPECT_NEAR(q.Mode()[kGain] * (0.5 + q.Mode()[kIdle]), truth[kGain] * (0.5 + truth[kIdle]), 0.02) << k;
  }
}

/// What the design makes of logs of the point mass at kTruth behind a channel of this value.
std::vector<double> ZBehind(const std::string& path, double low, double high, double value, double noise = 0) {
  const auto factory = PointMassBehind(path, low, high);
  const Dataset logs = RandomLogs(*factory->Make(20, 1), {kTruth[0], kTruth[1], kTruth[2], value});
  const ReplayFit fit = Match(noise > 0 ? WithSensorNoise(logs, noise, RngKey(8)) : logs, *factory, 1);
  return LogitToZ(factory->parameters(), {fit.mean.data(), static_cast<size_t>(fit.mean.size())});
}

TEST(MatchTrajectories, IsExactWherePositionsAloneAreLogged) {
  PositionAlone target(8, 1);
  const std::vector<double> z = Z(Match(RandomLogs(target, kTruth), PositionAloneFactory(), 1));
  EXPECT_NEAR(z[kGain], 1.5, 1e-5);
  EXPECT_NEAR(z[kDamping], 0.6, 1e-5);
}

TEST(MatchTrajectories, FindsParametersFromNoisyPositionsAlone) {
  PositionAlone target(60, 1);
  const Dataset logs = WithSensorNoise(RandomLogs(target, kTruth), 0.02, RngKey(3));
  const ReplayFit fit = Match(logs, PositionAloneFactory(), 1);
  EXPECT_NEAR(Z(fit)[kGain], 1.5, 0.075);
  EXPECT_NEAR(Z(fit)[kDamping], 0.6, 0.03);
  EXPECT_NEAR(fit.evidence->noise_std[0], 0.02, 0.003);
  ASSERT_TRUE(fit.evidence->unseen);
  EXPECT_NEAR(fit.evidence->unseen->z[kGain], 1.5, 0.15) << "of the logs that were not kept aside";
}

TEST(MatchTrajectories, FindsTheLagAndTheBiasOfASensorAndTheDelayOfActions) {
  for (const double lag : {0.0, 1.5, 2.0}) {
    const std::vector<double> z = ZBehind("obs/v/delay", 0, 3, lag);
    EXPECT_NEAR(z[3], lag, 0.02) << "control steps";
    EXPECT_NEAR(z[kGain], 1.5, 0.01) << lag;
    EXPECT_NEAR(z[kDamping], 0.6, 0.01) << lag;
  }
  EXPECT_NEAR(ZBehind("obs/v/bias", -1, 1, 0.4)[3], 0.4, 1e-4);
  EXPECT_NEAR(ZBehind("obs/v/bias", -1, 1, 0.4, 0.02)[3], 0.4, 0.02);
  for (const double delay : {0.0, 1.5, 3.0}) EXPECT_NEAR(ZBehind("action/delay", 0, 4, delay)[3], delay, 0.02);
  EXPECT_NEAR(ZBehind("obs/v/delay", 0, 3, 1.5, 0.02)[3], 1.5, 0.075);
}

TEST(MatchTrajectories, ReadsAnEncoderNoFinerThanItsSteps) {
  Dataset logs = PointMassLogs(kTruth, 20);
  const double step = 0.01;
  for (Array2<double>* rows : {&logs.observations, &logs.next_observations}) {
    for (int i = 0; i < rows->rows(); ++i) {
      for (double& value : rows->row(i)) value = std::round(value / step) * step;
    }
  }
  const ReplayFit fit = Match(logs);
  EXPECT_NEAR(Z(fit)[kGain], 1.5, 0.01);
  EXPECT_NEAR(Z(fit)[kDamping], 0.6, 0.01);
  for (const double std : fit.evidence->noise_std) EXPECT_GE(std, 0.999 * step / std::sqrt(12.0));
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
              testing::HasSubstr("design.method=paper"));
}

}  // namespace oted::trajectory_matching_test
