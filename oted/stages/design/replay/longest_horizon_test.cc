#include "oted/stages/design/replay/longest_horizon.h"

#include <gtest/gtest.h>

#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::longest_horizon_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

/// Of ten episodes of so many steps of 0.1 s.
Dataset LogsOf(int n_steps) { return PointMassLogs(kTruth, 10, {.max_episode_steps = n_steps}); }

std::optional<HeldOutPrediction::Horizon> Longest(const Dataset& kept_aside, const std::vector<double>& z,
                                                  const Dataset* learned = nullptr) {
  const PointMassFactory factory;
  const VectorXd noise = VectorXd::Constant(2, 1e-6);
  const ReadingModel readings = ReadingModel::Of(factory.spec(), kept_aside);
  const PredictionProblem problem{.factory = factory,
                                  .kept_aside = kept_aside,
                                  .learned = learned,
                                  .z = z,
                                  .noise = noise,
                                  .readings = readings,
                                  .narrow = {},
                                  .key = RngKey(1)};
  return LongestPredicted(problem, factory.parameters().Nominal(), 10);
}

TEST(LongestPredicted, IsAsLongAsTheEpisodesOfASimulatorThatIsRight) {
  EXPECT_FALSE(Longest(LogsOf(15), kTruth).has_value());
  for (const auto& [n_steps, seconds] : {std::pair(30, 2.0), {60, 5.0}, {120, 10.0}}) {
    const auto longest = Longest(LogsOf(n_steps), kTruth);
    ASSERT_TRUE(longest.has_value()) << n_steps;
    EXPECT_NEAR(longest->seconds, seconds, 1e-9);
    EXPECT_LE(longest->n_windows, 8);
    EXPECT_GT(longest->gain.value, 1) << "over the nominal simulator";
    EXPECT_LT(longest->channels[1].designed, 1e-4);
  }
}

TEST(LongestPredicted, ShowsADesignThatIsWorseThanTheNominalSimulator) {
  const PointMassFactory factory;
  const Dataset logs = PointMassLogs(factory.parameters().Nominal(), 10, {.max_episode_steps = 60});
  const auto longest = Longest(logs, kTruth);
  ASSERT_TRUE(longest.has_value()) << "the nominal simulator is followed";
  EXPECT_LT(longest->gain.value, -1);
}

TEST(LongestPredicted, IsNoneWhereNeitherSimulatorIsBetterThanAGuess) {
  EXPECT_FALSE(Longest(WithSensorNoise(LogsOf(60), 30.0, RngKey(1)), kTruth).has_value());
}

TEST(LongestPredicted, IsNoneWhereOneChannelIsNoBetterThanAGuess) {
  Dataset logs = LogsOf(60);
  Rng rng = RngKey(2).MakeRng();
  for (int row = 0; row < logs.size(); ++row) {  // the position is as it was, the velocity anything
    logs.observations(row, 1) = rng.Normal();
    logs.next_observations(row, 1) = rng.Normal();
  }
  EXPECT_FALSE(Longest(logs, kTruth).has_value());
}

TEST(LongestPredicted, IsOfLearnedLogsWhereThoseKeptAsideAreTooShort) {
  const Dataset brief = LogsOf(15), learned = LogsOf(60);
  const auto longest = Longest(brief, kTruth, &learned);
  ASSERT_TRUE(longest.has_value());
  EXPECT_TRUE(longest->learned);
  EXPECT_NEAR(longest->seconds, 5, 1e-9);
  EXPECT_FALSE(Longest(LogsOf(30), kTruth, &learned)->learned) << "kept aside, though shorter";
}

}  // namespace oted::longest_horizon_test
