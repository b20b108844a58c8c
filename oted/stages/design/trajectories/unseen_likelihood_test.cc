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

const WindowNoise kWhite = {VectorXd::Constant(2, kNoise* kNoise)};

/// The nats that noisy logs of kTruth give `a` over `b`.
Estimated Nats(const std::vector<double>& a, const std::vector<double>& b, uint64_t seed, int begins = kBrief,
               const WindowNoise& noise = kWhite) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 20), kNoise, RngKey(seed));
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 32, 1), logs);
  const Level windows = LongWindows(replayer, logs, begins, 100000, 0.05);
  const auto costs = [&](const std::vector<double>& z) { return CostsOf(replayer, windows, kSteps, noise, z); };
  return *NatsGained(costs(a), costs(b));
}

TEST(NatsGained, TheLogsOwnSimulatorIsSurelyLikelierThanAnother) {
  for (uint64_t seed = 0; seed < 4; ++seed) {
    const Estimated nats = Nats(kTruth, kWrong, seed);
    EXPECT_GT(nats.value, 4 * nats.error);
    EXPECT_GT(nats.value, 8);
    const Estimated reverse = Nats(kWrong, kTruth, seed);
    EXPECT_DOUBLE_EQ(reverse.value, -nats.value);
    EXPECT_DOUBLE_EQ(reverse.error, nats.error);
  }
  EXPECT_EQ(Nats(kTruth, kTruth, 1).value, 0);
}

TEST(NatsGained, LongWindowsWhoseErrorsGrowTellTheTruthToo) {
  const WindowNoise growing = {VectorXd::Constant(2, 0.04 * 0.04), kWhite.variance};
  const Estimated nats = Nats(kTruth, kWrong, 1, kSteps, growing);
  EXPECT_GT(nats.value, 4 * nats.error);
}

TEST(NatsGained, NoWindowCountsForMoreThanTheWorstThatNoiseExplains) {
  const int n_windows = PointMassLogs(kTruth, 20).size() / kSteps;
  const double worst = WindowLikelihood(ReadingModel::Plain(2), kWhite.variance, kSteps).CostOfWorstExplained();
  const double nats = Nats(kTruth, {0.2, 0.6, 0.5}, 1).value;
  EXPECT_GT(nats, 0);
  EXPECT_LE(nats, n_windows * worst);
}

TEST(NatsGained, EqualSimulatorsAreHardlyEverSurelyLikelier) {
  // z that differ by a hundredth of what the logs can tell.
  int n_sure = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Estimated nats = Nats({1.5001, 0.6, 0.5}, kTruth, seed);
    n_sure += nats.value > std::max(8.0, 2 * nats.error);
  }
  EXPECT_EQ(n_sure, 0);
}

/// Two simulators that leave equal residuals, one of which takes more of them for noise.
TEST(NatsGained, NoiseThatTheLogsDoNotHaveMakesThemLessLikely) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 20), kNoise, RngKey(1));
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 32, 1), logs);
  const Level windows = LongWindows(replayer, logs, kBrief, 100000, 0.05);
  const auto costs = [&](double times) {
    return CostsOf(replayer, windows, kSteps, {times * kWhite.variance}, kTruth);
  };
  const std::optional<Estimated> nats = NatsGained(costs(1), costs(2));
  EXPECT_GT(nats->value, 8);
  EXPECT_GT(nats->value, 3 * nats->error);
}

TEST(NatsGained, ComparesThePartsThatBothHaveAndOnlyTheSameWindows) {
  const WindowCosts both = {{{{0, 8}, VectorXd::Constant(2, 3.0)}, {{0, 8, 16}, VectorXd::Constant(3, 1.0)}}};
  const WindowCosts one = {{{{0, 8}, VectorXd::Constant(2, 2.0)}}};
  const WindowCosts less = {{{{0, 8}, VectorXd::Constant(2, 2.0)}, {{0, 8, 16}, VectorXd::Constant(3, 0.5)}}};
  EXPECT_DOUBLE_EQ(NatsGained(less, both)->value, 3.5);
  EXPECT_DOUBLE_EQ(NatsGained(one, both)->value, 2);
  EXPECT_DOUBLE_EQ(NatsGained(both, one)->value, -2);
  EXPECT_FALSE(NatsGained(both, {{{{0, 9}, VectorXd::Constant(2, 2.0)}}}).has_value());
}

TEST(NatsGained, OneWindowTellsNothingOfChance) {
  const Dataset logs = PointMassLogs(kTruth, 1);
  WindowReplayer replayer(std::make_unique<PointMass>(PointMassOptions{}, 32, 1), logs);
  Level one = LongWindows(replayer, logs, kSteps, 100000, 0.05);
  one.windows.resize(1);
  one.starts.resize(1);
  one.stretch.resize(1);
  const WindowCosts costs = CostsOf(replayer, one, kSteps, kWhite, kTruth);
  EXPECT_TRUE(std::isinf(NatsGained(costs, costs)->error));
}

}  // namespace oted::unseen_likelihood_test
