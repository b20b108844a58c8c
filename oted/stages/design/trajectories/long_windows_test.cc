#include "oted/stages/design/trajectories/long_windows.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/log.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/designer.h"
#include "oted/matching/held_out.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/testing.h"

namespace oted::long_windows_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

TEST(LongWindows, CoverTheLogsAndJoinThoseOfASecondIntoAStretch) {
  const Dataset logs = PointMassLogs(kTruth, 2);  // 20 steps of 0.1 s each
  WindowReplayer replayer(PointMassFactory().Make(1, 1), logs);
  const Level level = LongWindows(replayer, logs, 5, 1000, 0.1);
  ASSERT_EQ(level.windows.size(), 8u);
  EXPECT_EQ(level.stretch, (std::vector<int>{0, 0, 1, 1, 2, 2, 3, 3}));
  for (const LogWindow& window : level.windows) EXPECT_EQ(window.n_steps, 5);
  EXPECT_EQ(LongWindows(replayer, logs, 5, 20, 0.1).windows.size(), 4u) << "a budget of rows";
}

TEST(GrowingWindows, CanBeJoinedToTheLengthThatIsAskedHoweverFewRowsOfTheLogsTheyAre) {
  const Dataset logs = PointMassLogs(kTruth, 10, {.max_episode_steps = 100});
  WindowReplayer replayer(PointMassFactory().Make(1, 1), logs);
  // 600 of 1000 rows: pieces that were drawn one by one would lie apart.
  Level level = GrowingWindows(replayer, logs, 3, 25, 600, 0.1);
  EXPECT_EQ(level.windows.size(), 25u * 8);
  for (const int n_steps : {6, 12, 24}) {
    level = Joined(level);
    ASSERT_FALSE(level.windows.empty());
    EXPECT_EQ(level.windows.front().n_steps, n_steps);
    EXPECT_EQ(level.windows.size(), 25u * 24 / static_cast<size_t>(n_steps));
  }
}

TEST(ChooseLongWindows, FindsTheParametersWhereNoiseHidesThemFromShortWindows) {
  // Noise as large as what a step changes; the short windows' answer is far off.
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 60), 0.2, RngKey(5));
  const HeldOutParts parts = AllLearn(HoldOut(logs, RngKey(6)).learn);
  const PointMassFactory factory;
  const Prior prior = Prior::Uniform(3);
  NullSink log;
  const LongFitChoice choice = ChooseLongWindows({.factory = factory,
                                                  .parts = parts,
                                                  .prior = prior,
                                                  .readings = ReadingModel::Of(factory.spec(), logs),
                                                  .short_x = VectorXd::Constant(3, -2.0),
                                                  .noise = VectorXd::Constant(2, 0.2),
                                                  .short_steps = 1},
                                                 {.log = &log}, [](const VectorXd&) {});
  EXPECT_GT(choice.n_steps, 1);
  const std::vector<double> z = LogitToZ(factory.parameters(), {choice.x.data(), 3});
  EXPECT_NEAR(z[0], kTruth[0], 0.15);
  EXPECT_NEAR(z[1], kTruth[1], 0.15);
}

TEST(ChooseLongWindows, KeepsParametersThatAreRight) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 30), 0.02, RngKey(5));
  const HeldOutParts parts = AllLearn(HoldOut(logs, RngKey(6)).learn);
  const PointMassFactory factory;
  const std::vector<double> truth = ZToLogit(factory.parameters(), kTruth);
  const Prior prior = Prior::Uniform(3);
  NullSink log;
  const LongFitChoice choice = ChooseLongWindows({.factory = factory,
                                                  .parts = parts,
                                                  .prior = prior,
                                                  .readings = ReadingModel::Of(factory.spec(), logs),
                                                  .short_x = Eigen::Map<const VectorXd>(truth.data(), 3),
                                                  .noise = VectorXd::Constant(2, 0.02),
                                                  .short_steps = 2},
                                                 {.log = &log}, [](const VectorXd&) {});
  EXPECT_EQ(choice.n_steps, 0);
}

TEST(TakesOver, AsksMoreWhereShortWindowsAreExplainedAndPredictBetterThanTheNominalSimulator) {
  const Eigen::MatrixXd ones = Eigen::MatrixXd::Constant(1, 6, 1.0);
  const auto nominal = [&] { return ones; };
  // Half of the error in the mean, but for one window: not two standard errors.
  const Eigen::MatrixXd better{{0.1, 0.1, 0.1, 0.1, 0.1, 2.4}};
  const Eigen::MatrixXd slightly_worse = Eigen::MatrixXd::Constant(1, 6, 1.05);
  const Eigen::MatrixXd slightly_better = Eigen::MatrixXd::Constant(1, 6, 0.95);
  EXPECT_TRUE(TakesOver(better, slightly_better, nominal, false));
  EXPECT_FALSE(TakesOver(better, slightly_better, nominal, true)) << "chance gives such a gain";
  EXPECT_TRUE(TakesOver(better, slightly_worse, nominal, true)) << "short windows mislead";
  EXPECT_FALSE(TakesOver(1.2 * ones, slightly_worse, nominal, true)) << "and so do the long ones";
  EXPECT_FALSE(TakesOver(1.2 * ones, slightly_worse, nominal, false)) << "surely worse";
}

}  // namespace oted::long_windows_test
