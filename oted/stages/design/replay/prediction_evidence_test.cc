#include "oted/stages/design/replay/prediction_evidence.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/matching/verdict.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/trajectories/noise_estimate.h"

namespace oted::prediction_evidence_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

/// Of noisy logs that the simulator at the truth made; judged at z, whose guess of the noise is `guess`.
HeldOutPrediction Evidence(const std::vector<double>& z, double noise, double guess, uint64_t seed) {
  const Dataset clean = PointMassLogs(kTruth, 25);
  const Dataset logs = noise > 0 ? WithSensorNoise(clean, noise, RngKey(seed)) : clean;
  const PointMassFactory factory;
  const VectorXd guessed = VectorXd::Constant(2, guess);
  const ReadingModel readings = ReadingModel::Of(factory.spec(), logs);
  const auto prediction = PredictLogs({.factory = factory,
                                       .kept_aside = logs,
                                       .learned = nullptr,
                                       .z = z,
                                       .noise = guessed,
                                       .readings = readings,
                                       .key = RngKey(seed + 100),
                                       .n_threads = 1});
  OTED_CHECK(prediction.has_value());
  return *prediction;
}

TEST(PredictLogs, TheTruthReachesTheFloorAtAnyNoiseAndFromAWrongGuessOfIt) {
  for (const auto& [noise, guess] : {std::pair(0.0, 1e-8), {0.02, 0.02}, {0.1, 0.1}, {0.05, 0.1}, {0.05, 0.04}}) {
    for (uint64_t seed = 1; seed <= 4; ++seed) {
      const HeldOutPrediction prediction = Evidence(kTruth, noise, guess, seed);
      EXPECT_EQ(prediction.horizons.size(), 3u);
      EXPECT_TRUE(ReachesFloor(prediction)) << noise << " guessed " << guess << ", seed " << seed;
      EXPECT_TRUE(PredictsBetter(prediction));
    }
  }
}

TEST(PredictLogs, TheFloorIsTheErrorThatTheNoiseLeavesInPredictionsOfTheTruth) {
  constexpr int kSeeds = 12;
  double log_ratio = 0;
  int n = 0;
  for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
    for (const HeldOutPrediction::Horizon& h : Evidence(kTruth, 0.05, 0.05, seed).horizons) {
      for (const HeldOutPrediction::Channel& c : h.channels) {
        log_ratio += std::log(c.floor / c.designed);
        ++n;
      }
    }
  }
  EXPECT_EQ(n, kSeeds * 3 * 2);
  EXPECT_NEAR(log_ratio / n, 0, 0.1);
}

TEST(PredictLogs, AParameterThatIsOffByATenthIsMoreThanTheSensorsExplain) {
  const std::vector<double> off = {1.35, 0.6, 0.5};
  EXPECT_FALSE(ReachesFloor(Evidence(off, 0.0, 1e-8, 1)));
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const HeldOutPrediction prediction = Evidence(off, 0.02, 0.02, seed);
    EXPECT_FALSE(ReachesFloor(prediction)) << seed;
    EXPECT_TRUE(PredictsBetter(prediction)) << "than the nominal simulator, which is off by a third";
  }
}

TEST(PredictLogs, EpisodesThatAreTooShortGiveNone) {
  PointMassOptions brief;
  brief.max_episode_steps = 4;
  const Dataset logs = PointMassLogs(kTruth, 3, brief);
  const PointMassFactory factory;
  const VectorXd noise = VectorXd::Constant(2, 0.01);
  const ReadingModel readings = ReadingModel::Of(factory.spec(), logs);
  EXPECT_FALSE(PredictLogs({.factory = factory,
                            .kept_aside = logs,
                            .learned = nullptr,
                            .z = kTruth,
                            .noise = noise,
                            .readings = readings,
                            .key = RngKey(1),
                            .n_threads = 1}));
}

TEST(PredictLogs, TheSameKeyGivesTheSameNumbers) {
  EXPECT_EQ(Evidence(kTruth, 0.05, 0.05, 1).horizons[1].excess.value,
            Evidence(kTruth, 0.05, 0.05, 1).horizons[1].excess.value);
}

TEST(SensorNoise, IsFoundAtTheTruth) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 100), 0.05, RngKey(7));
  const PointMassFactory factory;
  const VectorXd noise = SensorNoise(factory, logs, ReadingModel::Of(factory.spec(), logs), kTruth, 1);
  EXPECT_NEAR(noise[0], 0.05, 0.01);
  EXPECT_NEAR(noise[1], 0.05, 0.01);
}

}  // namespace oted::prediction_evidence_test
