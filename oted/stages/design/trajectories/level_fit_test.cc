#include "oted/stages/design/trajectories/level_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "oted/base/statistics.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/stages/design/testing.h"

namespace oted::level_fit_test {

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

constexpr int kSteps = 10;

/// Windows of kSteps from their logged readings, each episode a stretch.
Level WindowsOf(const Dataset& logs, const WindowReplayer& replayer) {
  Level level;
  for (const Episode& episode : logs.Episodes()) {
    for (int i = episode.begin; i + kSteps <= episode.end; i += kSteps) {
      level.windows.push_back({i, kSteps, episode.begin});
      level.starts.push_back(replayer.Logged(level.windows.back(), 0));
      level.stretch.push_back(episode.begin);
    }
  }
  return level;
}

Eigen::VectorXd TrueX(const ParameterSpace& space) {
  const std::vector<double> x = ZToLogit(space, kTruth);
  return Eigen::Map<const Eigen::VectorXd>(x.data(), static_cast<Eigen::Index>(x.size()));
}

TEST(LevelFit, WindowsCaughtInALocalMinimumAreExplainedFromOtherStarts) {
  double caught_before = 0, caught_after = 0;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    BetweenWalls target(20, 1);
    const Dataset logs = WithSensorNoise(RandomLogs(target, kTruth), 0.05, RngKey(seed));
    WindowReplayer replayer(std::make_unique<BetweenWalls>(64, 1), logs);
    const ParameterSpace space = PointMass::MakeParameters();
    const Prior prior = Prior::Uniform(3);
    const Eigen::VectorXd scale = ChannelScales(logs);
    LevelFit fit(replayer, space, prior, scale, WindowsOf(logs, replayer), TrueX(space));
    for (int i = 0; i < 8; ++i) fit.Step();
    caught_before += 1 - fit.ShareExplained();
    Rng rng = RngKey(seed).Stage("starts").MakeRng();
    for (int round = 0; round < 2 && fit.TryOtherStarts(rng); ++round) {
      for (int i = 0; i < 3; ++i) fit.Step();
    }
    caught_after += 1 - fit.ShareExplained();
  }
  EXPECT_GT(caught_before, 0.3);
  EXPECT_LT(caught_after, 0.6 * caught_before);
}

TEST(LevelFit, GoingOnWithoutWindowsComesToTheFitThatNeverHadThem) {
  // The first half of the recordings is of another gain.
  Dataset logs = PointMassLogs({1.0, 0.6, 0.5}, 10);
  const int n_other = logs.size();
  logs.Append(PointMassLogs(kTruth, 10));
  logs = WithSensorNoise(logs, 0.1, RngKey(1));
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 64, 1), logs);
  const ParameterSpace space = PointMass::MakeParameters();
  const Prior prior = Prior::Uniform(3);
  const Eigen::VectorXd scale = ChannelScales(logs);
  const auto settled = [](LevelFit fit) {
    for (int i = 0; i < 12; ++i) fit.Step();
    return fit;
  };
  const LevelFit both = settled({replayer, space, prior, scale, WindowsOf(logs, replayer), TrueX(space)});
  Level alone;
  std::vector<char> left_out;
  for (size_t w = 0; w < both.level().windows.size(); ++w) {
    left_out.push_back(both.level().windows[w].begin < n_other ? 1 : 0);
    if (left_out.back() != 0) continue;
    alone.windows.push_back(both.level().windows[w]);
    alone.starts.push_back(replayer.Guess(alone.windows.back()));
    alone.stretch.push_back(both.level().stretch[w]);
  }
  const Eigen::VectorXd wanted = settled({replayer, space, prior, scale, alone, TrueX(space)}).x();
  const Eigen::VectorXd found = settled(both.LeavingOut(left_out)).x();
  EXPECT_LT((found - wanted).cwiseAbs().maxCoeff(), 1e-3);
  EXPECT_GT((both.x() - wanted).cwiseAbs().maxCoeff(), 0.1);
}

TEST(LevelFit, ASampleHoldsWindowsFromAllOfTheLogs) {
  const Dataset logs = PointMassLogs(kTruth, 20);
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 64, 1), logs);
  const ParameterSpace space = PointMass::MakeParameters();
  const Prior prior = Prior::Uniform(3);
  const Eigen::VectorXd scale = ChannelScales(logs);
  const LevelFit fit(replayer, space, prior, scale, WindowsOf(logs, replayer), TrueX(space));
  for (const int n_rows : {kSteps, 70, fit.n_rows() / 3, fit.n_rows()}) {
    const LevelFit sample = fit.Sampled(n_rows);
    EXPECT_GE(sample.n_rows(), n_rows);
    EXPECT_LT(sample.n_rows(), 2 * n_rows + kSteps);
    int longest = logs.size() - sample.level().windows.back().begin;
    for (size_t w = 1; w < sample.level().windows.size(); ++w) {
      longest = std::max(longest, sample.level().windows[w].begin - sample.level().windows[w - 1].begin);
    }
    EXPECT_LT(longest, 3 * logs.size() * kSteps / n_rows) << n_rows;
  }
  EXPECT_EQ(fit.Sampled(10 * fit.n_rows()).n_rows(), fit.n_rows());
}

TEST(LevelFit, AWindowThatCannotBeReplayedSaysNothingWhereverItStands) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 20), 0.02, RngKey(1));
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 64, 1), logs);
  const ParameterSpace space = PointMass::MakeParameters();
  const Prior prior = Prior::Uniform(3);
  const Eigen::VectorXd scale = ChannelScales(logs);
  const Level all = WindowsOf(logs, replayer);
  for (const size_t broken : {size_t{0}, all.windows.size() / 2, all.windows.size() - 1}) {
    Level with = all, without = all;
    with.starts[broken].setConstant(std::numeric_limits<double>::quiet_NaN());
    const auto at = static_cast<std::ptrdiff_t>(broken);
    without.windows.erase(without.windows.begin() + at);
    without.starts.erase(without.starts.begin() + at);
    without.stretch.erase(without.stretch.begin() + at);
    std::vector<Eigen::VectorXd> x;
    std::vector<Eigen::MatrixXd> covariance;
    for (const Level& level : {with, without}) {
      LevelFit fit(replayer, space, prior, scale, level, TrueX(space));
      fit.Step();
      fit.FinalCost();
      covariance.push_back(fit.Finish());
      x.push_back(fit.x());
    }
    EXPECT_LT((x[0] - x[1]).norm(), 1e-9 * x[1].norm());
    EXPECT_LT((covariance[0] - covariance[1]).norm(), 1e-9 * covariance[1].norm());
  }
}

/// Logs of windows whose errors grow to a twentieth at their end, those of one window all alike or each by itself.
Dataset LogsThatErr(bool alike) {
  Dataset logs = PointMassLogs(kTruth, 40);
  Rng rng(1);
  for (const Episode& episode : logs.Episodes()) {
    for (int begin = episode.begin; begin + kSteps <= episode.end; begin += kSteps) {
      for (size_t channel = 0; channel < 2; ++channel) {
        double size = rng.Normal();
        for (int t = 1; t <= kSteps; ++t) {
          const int row = begin + t - 1;
          if (!alike) size = rng.Normal();
          const double error = 0.05 * size * t / kSteps;
          logs.next_observations.row(row)[channel] += error;
          if (t < kSteps) logs.observations.row(row + 1)[channel] += error;
        }
      }
    }
  }
  return logs;
}

/// By how much a prior at nought moves the gain's x from where such windows put it.
double PullOfPrior(bool alike) {
  const Dataset logs = LogsThatErr(alike);
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 64, 1), logs);
  const ParameterSpace space = PointMass::MakeParameters();
  const Eigen::VectorXd scale = ChannelScales(logs), sensor = Eigen::Vector2d(1e-4, 1e-4);
  const auto settled = [&](const Prior& prior) {
    LevelFit fit(replayer, space, prior, scale, WindowsOf(logs, replayer), TrueX(space));
    fit.LetErrorsGrow(sensor.cwiseAbs2());
    for (int i = 0; i < 12; ++i) fit.Step();
    return fit.x();
  };
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(3);
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(3, 3);
  return (settled(Prior::Gaussian(zero, identity)) - settled(Prior::Gaussian(zero, 1e6 * identity)))[0];
}

TEST(LevelFit, WhereErrorsGrowReadingsThatErrAsOneCountAsOneBesideThePrior) {
  const double by_itself = PullOfPrior(false), alike = PullOfPrior(true);
  EXPECT_LT(by_itself, 0);
  EXPECT_NEAR(alike / by_itself, kSteps, 3);
}

/// What one fit of such windows says of the gain's x, with this much noise of the sensors beside their own errors.
struct Noisy {
  double x, std_of_noise, std_of_parts;
};

Noisy FitNoisy(double noise, uint64_t seed) {
  const Dataset logs = WithSensorNoise(LogsThatErr(true), noise, RngKey(seed));
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 64, 1), logs);
  const ParameterSpace space = PointMass::MakeParameters();
  const Prior prior = Prior::Uniform(3);
  const Eigen::VectorXd scale = ChannelScales(logs), sensor = Eigen::Vector2d(noise, noise);
  LevelFit fit(replayer, space, prior, scale, WindowsOf(logs, replayer), TrueX(space));
  fit.LetErrorsGrow(sensor.cwiseAbs2());
  for (int i = 0; i < 12; ++i) fit.Step();
  const double of_parts = std::sqrt(fit.CovarianceOfParts()(0, 0));
  return {fit.x()[0], std::sqrt(fit.CovarianceOfNoise(2 * sensor)(0, 0)), of_parts};
}

TEST(LevelFit, WhereErrorsGrowTheCovarianceOfNoiseIsHowFarNoiseAloneMovesX) {
  for (const double noise : {1e-4, 1e-3}) {
    std::vector<double> x;
    for (uint64_t seed = 1; seed <= 40; ++seed) x.push_back(FitNoisy(noise, seed).x);
    const Noisy one = FitNoisy(noise, 1);
    EXPECT_NEAR(one.std_of_noise / StandardDeviation(x), 1, 0.4) << noise;
    EXPECT_LT(one.std_of_noise, 0.5 * one.std_of_parts) << "the windows' own errors are none of the noise's doing";
  }
}

}  // namespace oted::level_fit_test
