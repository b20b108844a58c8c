#include "oted/stages/design/level_fit.h"

#include <gtest/gtest.h>

#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/matching/testing.h"
#include "oted/stages/design/testing.h"

namespace oted {
namespace {

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

TEST(LevelFit, WindowsCaughtInALocalMinimumAreExplainedFromOtherStarts) {
  constexpr int kSteps = 10;
  double caught_before = 0, caught_after = 0;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    BetweenWalls target(20, 1);
    const Dataset logs = WithSensorNoise(RandomLogs(target, kTruth), 0.05, RngKey(seed));
    WindowReplayer replayer(std::make_unique<BetweenWalls>(64, 1), logs);
    Level level;
    for (const Episode& episode : logs.Episodes()) {
      for (int i = episode.begin; i + kSteps <= episode.end; i += kSteps) {
        level.windows.push_back({i, kSteps, episode.begin});
        level.starts.push_back(replayer.Logged(level.windows.back(), 0));
        level.stretch.push_back(episode.begin);
      }
    }
    const ParameterSpace space = PointMass::MakeParameters();
    const Prior prior = Prior::Uniform(3);
    const Eigen::VectorXd scale = ChannelScales(logs);
    const std::vector<double> truth = ZToLogit(space, kTruth);
    LevelFit fit(replayer, space, prior, scale, level, Eigen::Map<const Eigen::VectorXd>(truth.data(), 3));
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

}  // namespace
}  // namespace oted
