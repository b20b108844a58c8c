#include "oted/sim/replay.h"

#include <gmock/gmock.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/testing.h"

namespace oted::replay_test {

using testing::ElementsAre;

/// `n_episodes` of 20 steps of lane 0, with actions that swing.
Dataset LogOf(Simulator& mass, int n_episodes) {
  Dataset d;
  const std::vector<int> lanes = {0};
  for (int i = 0; i < 20 * n_episodes; ++i) {
    Rng rng(static_cast<uint64_t>(i));
    if (i % 20 == 0) mass.Reset(0, rng);
    const std::vector<double> action = {std::sin(0.7 * i)};
    d.observations.AppendRow(mass.observation(0));
    d.actions.AppendRow(action);
    mass.Step(lanes, action);
    d.next_observations.AppendRow(mass.observation(0));
    d.terminals.push_back(0);
    d.timeouts.push_back(i % 20 == 19);
  }
  return d;
}

/// The same of the point mass at `gain`.
Dataset SwingLog(double gain, int n_episodes) {
  PointMass mass(PointMassOptions{}, 1, 1);
  mass.SetParameters(0, std::vector{gain, 0.5, 0.0});
  return LogOf(mass, n_episodes);
}

TEST(ReplayTest, TheTrueParametersReproduceTheLogToTheLastBit) {
  const Dataset d = SwingLog(1.3, 4);
  PointMass mass(PointMassOptions{}, 3, 1);
  const std::vector<int> begins = {0, 25, 70};
  const auto windows = ReplayWindows(mass, d, AsLogged(begins), 10, std::vector{1.3, 0.5, 0.0});
  ASSERT_EQ(windows.size(), 3u);
  for (size_t i = 0; i < begins.size(); ++i) EXPECT_EQ(windows[i], LoggedWindow(d, begins[i], 10));
}

TEST(ReplayTest, ALogMadeWithADelayIsReproducedFromAnyWindowAtTheTrueDelay) {
  std::vector<ParameterSpec> specs = PointMass::MakeParameters().specs();
  specs.push_back({.name = "delay", .field = "action/delay", .low = 0, .high = 3, .scale = ParameterScale::kAbsolute});
  const auto factory = WithChannels(specs, [](const auto&) { return std::make_unique<PointMassFactory>(); });
  const std::vector<double> truth = {1.3, 0.5, 0.0, 2.5};
  const auto target = factory->Make(1, 1);
  target->SetParameters(0, truth);
  const Dataset d = LogOf(*target, 4);
  const auto simulator = factory->Make(4, 1);
  const std::vector<int> begins = {0, 1, 25, 70};
  const auto windows = ReplayWindows(*simulator, d, AsLogged(begins), 10, truth);
  for (size_t i = 0; i < begins.size(); ++i) {
    const std::vector<double> error = ReplayError(LoggedWindow(d, begins[i], 10), windows[i], ChannelSpreads(d));
    EXPECT_THAT(error, testing::Each(testing::Le(1e-12))) << "from row " << begins[i];
  }
  // Without the delay the same windows part from the log.
  const auto prompt = ReplayWindows(*simulator, d, AsLogged(begins), 10, std::vector{1.3, 0.5, 0.0, 0.0});
  EXPECT_GT(ReplayError(LoggedWindow(d, 25, 10), prompt[2], ChannelSpreads(d))[1], 0.1);
}

TEST(ReplayTest, AWrongGainPartsFromTheLogAsTheEquationsSay) {
  const Dataset d = SwingLog(1.0, 1);
  PointMass mass(PointMassOptions{}, 1, 1);
  const auto windows = ReplayWindows(mass, d, AsLogged(std::vector{3}), 2, std::vector{1.5, 0.5, 0.0});
  const Array2<double> logged = LoggedWindow(d, 3, 2);
  EXPECT_EQ(windows[0](0, 0), logged(0, 0));
  // v' = (1 - damping) v + gain a: half of the first action comes on top.
  EXPECT_NEAR(windows[0](1, 1) - logged(1, 1), 0.5 * d.actions(3, 0), 1e-12);
  EXPECT_NEAR(windows[0](2, 1) - logged(2, 1), 0.5 * (0.5 * d.actions(3, 0)) + 0.5 * d.actions(4, 0), 1e-12);
}

TEST(ReplayTest, StartsLieWithinEpisodesAndAreSpreadOverAllOfThem) {
  const Dataset d = SwingLog(1.0, 4);
  PointMass mass(PointMassOptions{}, 1, 1);
  const std::vector<int> starts = ReplayStarts(mass, d, 15, 4);
  ASSERT_EQ(starts.size(), 4u);
  for (size_t i = 0; i < starts.size(); ++i) {
    EXPECT_EQ(starts[i] / 20, static_cast<int>(i)) << "one in each episode";
    EXPECT_LE(starts[i] % 20 + 15, 20) << "runs over the episode's end";
  }
  EXPECT_THAT(ReplayStarts(mass, d, 20, 100), ElementsAre(0, 20, 40, 60));
  EXPECT_TRUE(ReplayStarts(mass, d, 21, 4).empty());
}

TEST(ReplayTest, AStateThatCannotBeSetIsSteppedOver) {
  const Dataset d = SwingLog(1.0, 1);
  PointMass mass(PointMassOptions{.velocity_clip = 0.8}, 1, 1);
  for (const int start : ReplayStarts(mass, d, 2, 100)) EXPECT_LT(std::abs(d.observations(start, 1)), 0.8);
  PointMass stiff(PointMassOptions{.can_set_state = false}, 1, 1);
  EXPECT_THAT(MessageOf<UsageError>([&] { ReplayStarts(stiff, d, 2, 4); }), testing::HasSubstr("PointMass"));
}

TEST(ReplayTest, FromADivergenceOnNothingIsKnownAndTheErrorIsInfinite) {
  const Dataset d = SwingLog(1.0, 1);
  PointMass mass(PointMassOptions{.diverge_beyond = 1e-3}, 1, 1);
  int calls = 0;
  const auto windows = ReplayWindows(mass, d, AsLogged(std::vector{2}), 3, std::vector{1.0, 0.5, 0.0},
                                     [&](int t) { EXPECT_EQ(t, calls++); });
  EXPECT_EQ(calls, 4);
  EXPECT_FALSE(std::isnan(windows[0](0, 0)));
  for (int t = 1; t <= 3; ++t) EXPECT_TRUE(std::isnan(windows[0](t, 0)));
  const auto error = ReplayError(LoggedWindow(d, 2, 3), windows[0], ChannelSpreads(d));
  EXPECT_EQ(error[0], 0);
  EXPECT_TRUE(std::isinf(error[1]));
}

TEST(ReplayErrorTest, IsTheRootMeanSquareInUnitsOfTheSpreads) {
  Array2<double> logged(2, 3, 0.0), replayed(2, 3, 0.0);
  replayed(1, 0) = 3 * 2.0;  // three spreads
  replayed(1, 1) = 4 * 0.5;  // four spreads
  replayed(1, 2) = 100;      // a channel that stands still in the logs does not count
  const std::vector<double> error = ReplayError(logged, replayed, std::vector{2.0, 0.5, 0.0});
  EXPECT_THAT(error, ElementsAre(0, std::sqrt(25 / 2.0)));
}

TEST(ReplayErrorTest, ASpreadIsTheStandardDeviationAndZeroWhereNothingMoves) {
  Dataset d = SwingLog(1.0, 2);
  for (int i = 0; i < d.size(); ++i) d.observations(i, 0) = i % 2 == 0 ? 1 : 5;
  for (int i = 0; i < d.size(); ++i) d.observations(i, 1) = 0.1;
  EXPECT_THAT(ChannelSpreads(d), ElementsAre(testing::DoubleNear(2, 1e-12), 0.0));
}

}  // namespace oted::replay_test
