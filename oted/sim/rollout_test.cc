#include "oted/sim/rollout.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/sim/testing.h"

namespace oted::rollout_test {

const std::vector<double> kNominal = {1, 1, 0};

/// Always the same action.
BatchPolicy Constant(double action) {
  return [action](std::span<const double>, int, std::span<double> actions) {
    std::fill(actions.begin(), actions.end(), action);
  };
}

/// The start of lane `k` under `key`, as the point mass draws it.
double StartOf(RngKey key, int k) {
  Rng rng = key.Index(static_cast<uint64_t>(k)).MakeRng();
  return rng.Uniform(-1, 1);
}

TEST(RunEpisodes, ReturnsAndLengthsAreThoseOfTheClosedForm) {
  const RngKey key(3);
  PointMass simulator({.max_episode_steps = 12}, 3, 1);
  const std::vector<std::vector<double>> z = {{1, 1, 0}, {0.5, 1, 0}, {2, 1, 1}};
  const auto episodes = RunEpisodes(simulator, z, Constant(0.7), key);
  ASSERT_EQ(episodes.size(), 3u);
  for (int k = 0; k < 3; ++k) {
    const EpisodeResult& episode = episodes[static_cast<size_t>(k)];
    double expected = 0;
    for (int t = 1; t <= 12; ++t) {
      expected -= std::pow(StartOf(key, k) + 0.07 * t * z[static_cast<size_t>(k)][0], 2);
    }
    EXPECT_NEAR(episode.episode_return, expected, 1e-12);
    EXPECT_EQ(episode.n_steps, 12);
    EXPECT_EQ(episode.end, LaneStatus::kTruncated);
  }
  EXPECT_DOUBLE_EQ(MeanReturn(episodes),
                   (episodes[0].episode_return + episodes[1].episode_return + episodes[2].episode_return) / 3);
  EXPECT_EQ(MeanReturn({}), 0);
}

TEST(RunEpisodes, LanesThatEndEarlyWaitAndDoNotDisturbTheOthers) {
  const RngKey key(4);
  const PointMassOptions options{.terminate_beyond = 1.5};
  const int n = 6;
  PointMass together(options, n, 1);
  std::vector<int> batch_sizes;
  const BatchPolicy push = [&](std::span<const double> observations, int running, std::span<double> actions) {
    EXPECT_EQ(observations.size(), 2u * static_cast<size_t>(running));
    EXPECT_EQ(actions.size(), static_cast<size_t>(running));
    batch_sizes.push_back(running);
    std::fill(actions.begin(), actions.end(), 1.0);
  };
  const auto episodes = RunEpisodes(together, std::vector(n, kNominal), push, key);
  std::vector<int> expected_sizes(20, 0);
  int shortest = 100, longest = 0;
  for (int k = 0; k < n; ++k) {
    // x0 + 0.1 t > 1.5 for the first time.
    const int length = static_cast<int>(std::floor((1.5 - StartOf(key, k)) / 0.1)) + 1;
    EXPECT_EQ(episodes[static_cast<size_t>(k)].n_steps, std::min(length, 20)) << k;
    EXPECT_EQ(episodes[static_cast<size_t>(k)].end, length <= 20 ? LaneStatus::kTerminated : LaneStatus::kTruncated);
    for (int t = 0; t < std::min(length, 20); ++t) ++expected_sizes[static_cast<size_t>(t)];
    shortest = std::min(shortest, length);
    longest = std::max(longest, std::min(length, 20));
  }
  ASSERT_LT(shortest, longest) << "the case tests nothing when all lanes end together";
  expected_sizes.resize(static_cast<size_t>(longest));
  EXPECT_EQ(batch_sizes, expected_sizes);
}

TEST(RunEpisodes, APolicyThatRemembersIsToldWhichRowsGoOn) {
  const RngKey key(4);
  const int n = 6;
  PointMass together({.terminate_beyond = 1.5}, n, 1);
  std::vector<double> starts;  // what it remembers of each row: where its episode began
  BatchPolicy push = [&](std::span<const double> observations, int running, std::span<double> actions) {
    ASSERT_EQ(starts.size(), static_cast<size_t>(running));
    for (size_t i = 0; i < starts.size(); ++i) {
      if (std::isnan(starts[i])) starts[i] = observations[2 * i];
      // Actions of 1 from there: a whole number of steps of 0.1.
      const double steps = (observations[2 * i] - starts[i]) / 0.1;
      EXPECT_NEAR(steps, std::round(steps), 1e-9) << "another row's memory";
    }
    std::fill(actions.begin(), actions.end(), 1.0);
  };
  push.begin = [&](int rows) { starts.assign(static_cast<size_t>(rows), NAN); };
  int n_told = 0;
  push.keep = [&](std::span<const int> rows) {
    std::vector<double> kept;
    for (const int row : rows) kept.push_back(starts[static_cast<size_t>(row)]);
    EXPECT_LT(kept.size(), starts.size()) << "told only when a row is over";
    starts = kept;
    ++n_told;
  };
  RunEpisodes(together, std::vector(n, kNominal), push, key);
  EXPECT_GT(n_told, 2) << "the case tests nothing when all lanes end together";
  EXPECT_TRUE(starts.empty());
}

TEST(RunEpisodes, TheObserverSeesEachStepOnceInOrder) {
  const RngKey key(5);
  PointMass simulator({.terminate_beyond = 1.2}, 4, 2);
  const BatchPolicy act = [](std::span<const double> observations, int n, std::span<double> actions) {
    for (int i = 0; i < n; ++i) {
      actions[static_cast<size_t>(i)] = observations[static_cast<size_t>(2 * i)] > 0 ? 0.9 : -0.4;
    }
  };
  std::vector<int> steps(4, 0);
  std::vector<double> sums(4, 0), last_x(4, 0);
  const auto episodes = RunEpisodes(simulator, std::vector(4, kNominal), act, key, [&](const StepView& step) {
    const size_t k = static_cast<size_t>(step.lane);
    const double expected_x = steps[k] == 0 ? StartOf(key, step.lane) : last_x[k];
    EXPECT_EQ(step.observation[0], expected_x);
    EXPECT_EQ(step.action[0], expected_x > 0 ? 0.9 : -0.4);
    EXPECT_NEAR(step.next_observation[0], expected_x + 0.1 * step.action[0], 1e-15);
    EXPECT_EQ(step.reward, -step.next_observation[0] * step.next_observation[0]);
    ++steps[k];
    sums[k] += step.reward;
    last_x[k] = step.next_observation[0];
    EXPECT_EQ(step.status == LaneStatus::kRunning, std::abs(last_x[k]) <= 1.2 && steps[k] < 20);
  });
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(steps[k], episodes[k].n_steps);
    EXPECT_EQ(sums[k], episodes[k].episode_return);
  }
}

TEST(RunEpisodes, ADivergedStepEndsItsLaneAndIsNotCounted) {
  const RngKey key(6);
  PointMass simulator({.diverge_beyond = 1.5}, 2, 1);
  const auto episodes = RunEpisodes(simulator, {{2, 1, 0}, {0.2, 1, 0}}, Constant(1), key);
  const int valid = static_cast<int>(std::floor((1.5 - StartOf(key, 0)) / 0.2));
  EXPECT_EQ(episodes[0].end, LaneStatus::kDiverged);
  EXPECT_EQ(episodes[0].n_steps, valid);
  double expected = 0;
  for (int t = 1; t <= valid; ++t) expected -= std::pow(StartOf(key, 0) + 0.2 * t, 2);
  EXPECT_NEAR(episodes[0].episode_return, expected, 1e-12);
  EXPECT_EQ(episodes[1].end, LaneStatus::kTruncated);
  EXPECT_EQ(episodes[1].n_steps, 20);
}

TEST(RunEpisodes, ASimulatorWithoutAClockNeedsOneInTheCall) {
  PointMass simulator({.max_episode_steps = 0}, 2, 1);
  const std::vector<std::vector<double>> z(2, kNominal);
  const std::string message = MessageOf<UsageError>([&] { RunEpisodes(simulator, z, Constant(0.1), RngKey(8)); });
  EXPECT_NE(message.find("PointMass"), std::string::npos) << message;
  std::vector<LaneStatus> seen;
  const auto episodes = RunEpisodes(
      simulator, z, Constant(0.1), RngKey(8), [&](const StepView& step) { seen.push_back(step.status); }, 7);
  for (const EpisodeResult& episode : episodes) {
    EXPECT_EQ(episode.n_steps, 7);
    EXPECT_EQ(episode.end, LaneStatus::kTruncated);
  }
  ASSERT_EQ(seen.size(), 14u);
  for (size_t i = 0; i < seen.size(); ++i) {
    EXPECT_EQ(seen[i], i < 12 ? LaneStatus::kRunning : LaneStatus::kTruncated) << "the observer sees the cut";
  }
}

TEST(RunEpisodes, TheCallsClockDoesNotDelayTheSimulatorsOwn) {
  PointMass simulator({.max_episode_steps = 5}, 1, 1);
  EXPECT_EQ(RunEpisodes(simulator, {kNominal}, Constant(0.1), RngKey(8), {}, 50)[0].n_steps, 5);
}

TEST(ComparableReturns, CountADivergedEpisodeAsTheLowestReturn) {
  const EpisodeResult good{.episode_return = -50, .n_steps = 20, .end = LaneStatus::kTruncated};
  const EpisodeResult bad{.episode_return = -80, .n_steps = 9, .end = LaneStatus::kTerminated};
  const EpisodeResult early{.episode_return = -1, .n_steps = 2, .end = LaneStatus::kDiverged};
  const EpisodeResult late{.episode_return = -90, .n_steps = 19, .end = LaneStatus::kDiverged};
  EXPECT_EQ(ComparableReturns({good, early, bad}), (std::vector<double>{-50, -80, -80}));
  EXPECT_EQ(ComparableReturns({early, good, late}), (std::vector<double>{-90, -50, -90}));
  EXPECT_EQ(ComparableReturns({good, bad}), (std::vector<double>{-50, -80}));
  EXPECT_TRUE(ComparableReturns({}).empty());
  EXPECT_DOUBLE_EQ(MeanReturn({good, early, bad}), -70);
  EXPECT_EQ(CountDiverged({early, good, late}), 2);
}

TEST(RunEpisodes, EpisodesAreTheSameAtAnyThreadCount) {
  const auto returns = [](int n_threads) {
    PointMass simulator({}, 5, n_threads);
    std::vector<double> values;
    for (const auto& e : RunEpisodes(simulator, std::vector(5, kNominal), Constant(0.3), RngKey(7))) {
      values.push_back(e.episode_return);
    }
    return values;
  };
  EXPECT_EQ(returns(1), returns(3));
}

TEST(UniformRandomPolicy, OfDiscreteActionsIsEachIndexEquallyOften) {
  SimulatorSpec spec;
  spec.act_dim = 1;
  spec.n_discrete_actions = 3;
  Rng rng(1);
  std::vector<double> actions(9000);
  UniformRandomPolicy(spec, rng)({}, 9000, actions);
  // Standard deviation of each count: 45.
  for (const double index : {0.0, 1.0, 2.0}) EXPECT_NEAR(std::ranges::count(actions, index), 3000, 180);
}

}  // namespace oted::rollout_test
