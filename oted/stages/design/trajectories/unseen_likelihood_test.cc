#include "oted/stages/design/trajectories/unseen_likelihood.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/trajectories/long_windows.h"

namespace oted::unseen_likelihood_test {

using Eigen::VectorXd;

constexpr double kNoise = 0.05;
constexpr int kBrief = 4, kSteps = 16;
const std::vector<double> kTruth = {1.5, 0.6, 0.5}, kWrong = {1.5, 0.7, 0.5};

Explanation With(const std::vector<double>& z, double noise) { return {z, VectorXd::Constant(2, noise * noise)}; }

/// The nats that noisy logs of kTruth give `a` over `b`.
Estimated Nats(const Explanation& a, const Explanation& b, uint64_t seed) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 20), kNoise, RngKey(seed));
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 32, 1), logs);
  return NatsGained(replayer, LongWindows(replayer, logs, kBrief, 100000, 0.05), kSteps, a, b);
}

TEST(NatsGained, TheLogsOwnSimulatorIsSurelyLikelierThanAnother) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const Estimated nats = Nats(With(kTruth, kNoise), With(kWrong, kNoise), seed);
    EXPECT_GT(nats.value, 4 * nats.error);
    EXPECT_GT(nats.value, 8);
    const Estimated reverse = Nats(With(kWrong, kNoise), With(kTruth, kNoise), seed);
    EXPECT_DOUBLE_EQ(reverse.value, -nats.value);
    EXPECT_DOUBLE_EQ(reverse.error, nats.error);
  }
  EXPECT_EQ(Nats(With(kTruth, kNoise), With(kTruth, kNoise), 1).value, 0);
}

TEST(NatsGained, TheRightNoiseIsLikelierThanTwiceAndHalf) {
  for (const double factor : {0.5, 2.0}) {
    const Estimated nats = Nats(With(kTruth, kNoise), With(kTruth, factor * kNoise), 1);
    EXPECT_GT(nats.value, 4 * nats.error) << factor;
  }
}

TEST(NatsGained, EqualSimulatorsAreHardlyEverSurelyLikelier) {
  // z that differ by a hundredth of what the logs can tell.
  int n_sure = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Estimated nats = Nats(With({1.5001, 0.6, 0.5}, kNoise), With(kTruth, kNoise), seed);
    n_sure += nats.value > std::max(8.0, 2 * nats.error);
  }
  EXPECT_EQ(n_sure, 0);
}

TEST(NatsGained, OneWindowTellsNothingOfChance) {
  const Dataset logs = PointMassLogs(kTruth, 1);
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 32, 1), logs);
  Level one = LongWindows(replayer, logs, kSteps, 100000, 0.05);
  one.windows.resize(1);
  one.starts.resize(1);
  one.stretch.resize(1);
  const Estimated nats = NatsGained(replayer, one, kSteps, With(kTruth, kNoise), With(kWrong, kNoise));
  EXPECT_TRUE(std::isinf(nats.error));
}

}  // namespace oted::unseen_likelihood_test
