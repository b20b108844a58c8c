#include "oted/baselines/interval_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <set>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/rl/ppo.h"
#include "oted/rl/sac.h"
#include "oted/rl/testing.h"
#include "oted/sim/testing.h"

namespace oted::interval_search_test {

const std::vector<double> kStart = {1.0, 0.6, 0.5};

ParameterSpace Space() { return PointMass::MakeParameters(); }

/// `n` episodes whose performance is a known function of z; checks on the way that no z leaves the range.
void Play(IntervalSearch& search, int n, const std::function<double(const std::vector<double>&)>& performance,
          uint64_t seed = 1) {
  Rng rng(seed);
  for (int k = 0; k < n; ++k) {
    const std::vector<double> z = search.Draw(k % 3, rng);
    Space().CheckInside(z);
    search.EpisodeEnded(k % 3, performance(z), false);
  }
}

TEST(IntervalSearch, BeginsAtItsStartAlone) {
  IntervalSearch search(Space(), kStart, {}, {});
  Rng rng(1);
  for (int k = 0; k < 20; ++k) {
    const std::vector<double> z = search.Draw(0, rng);
    for (size_t i = 0; i < z.size(); ++i) EXPECT_NEAR(z[i], kStart[i], 1e-12);
  }
}

TEST(IntervalSearch, AnAgentThatDoesWellEverywhereGetsTheWholeRange) {
  IntervalSearch search(Space(), kStart, {}, {});
  Play(search, 4000, [](const auto&) { return 1.0; });
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(search.Low()[static_cast<size_t>(i)], Space()[i].low);
    EXPECT_EQ(search.High()[static_cast<size_t>(i)], Space()[i].high);
  }
}

TEST(IntervalSearch, AnEndStopsWithinAStepOfWhereTheAgentBeginsToFail) {
  // The agent copes with gains between 0.6 and 1.4; steps are a tenth of the range, 0.18.
  IntervalSearch search(Space(), kStart, {}, {});
  const auto copes = [](const std::vector<double>& z) { return z[0] > 0.6 && z[0] < 1.4 ? 1.0 : 0.0; };
  std::set<int> lows, highs;
  Play(search, 2000, copes);
  for (uint64_t k = 0; k < 200; ++k) {
    Play(search, 10, copes, k);
    lows.insert(static_cast<int>(std::lround(100 * search.Low()[0])));
    highs.insert(static_cast<int>(std::lround(100 * search.High()[0])));
  }
  EXPECT_EQ(lows, (std::set<int>{46, 64})) << "out to where it fails, and back";
  EXPECT_EQ(highs, (std::set<int>{136, 154}));
}

TEST(IntervalSearch, AnAgentThatGetsWorseLosesTheIntervalButNotTheStart) {
  IntervalSearch search(Space(), kStart, {}, {});
  Play(search, 400, [](const auto&) { return 1.0; });
  EXPECT_GT(search.High()[0], kStart[0] + 0.1);
  EXPECT_LT(search.Low()[0], kStart[0] - 0.1);
  Play(search, 4000, [](const auto&) { return 0.0; });
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(search.Low()[i], kStart[i], 1e-12);
    EXPECT_NEAR(search.High()[i], kStart[i], 1e-12);
  }
}

TEST(IntervalSearch, BetweenTheThresholdsNothingMoves) {
  IntervalSearch search(Space(), kStart, {}, {});
  const auto middling = [](const auto&) { return 0.15; };
  Play(search, 100, [](const auto&) { return 1.0; });
  Play(search, 200, middling);  // what was collected before is decided on
  const auto low = search.Low(), high = search.High();
  EXPECT_GT(high[0], kStart[0] + 0.1);
  Play(search, 1000, middling);
  EXPECT_EQ(search.Low(), low);
  EXPECT_EQ(search.High(), high);
}

TEST(IntervalSearch, TheBoundarysShareOfEpisodesLiesAtAnEndAndTheRestIsUniform) {
  IntervalSearch search(Space(), kStart, {.boundary = 0.3, .episodes = 1 << 30}, {});
  NpzArrays state;
  search.Save(state);
  state["interval/low"] = NpyArray(std::vector<double>{0, 0, 0});
  state["interval/high"] = NpyArray(std::vector<double>{1, 1, 1});
  search.Restore(state);
  Rng rng(2);
  constexpr int kDraws = 6000;
  int at_an_end = 0, gain_low = 0;
  double sum = 0;
  for (int k = 0; k < kDraws; ++k) {
    const std::vector<double> u = Space().ToUnit(search.Draw(0, rng));
    int ends = 0;
    for (const double value : u) ends += value == 0 || value == 1;
    at_an_end += ends == 1;
    gain_low += u[0] == 0;
    if (ends == 0) sum += u[0];
  }
  EXPECT_NEAR(at_an_end, 0.3 * kDraws, 5 * std::sqrt(0.21 * kDraws));
  EXPECT_NEAR(gain_low, 0.05 * kDraws, 5 * std::sqrt(0.05 * 0.95 * kDraws)) << "one of six ends";
  const int inside = kDraws - at_an_end;
  EXPECT_NEAR(sum / inside, 0.5, 5 * std::sqrt(1.0 / 12 / inside));
}

TEST(IntervalSearch, ADivergedEpisodeIsAFailureWhateverItReturned) {
  IntervalSearch search(Space(), kStart, {}, {});
  Play(search, 400, [](const auto&) { return 1.0; });
  Rng rng(1);
  for (int k = 0; k < 4000; ++k) {
    search.Draw(0, rng);
    search.EpisodeEnded(0, 1000.0, true);
  }
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(search.High()[i], kStart[i], 1e-12);
}

struct Training {
  std::filesystem::path folder;
  const std::atomic<bool>* stop = nullptr;
  EvaluationObserver observer = {};

  ReplayAgent operator()(IntervalSearch& search) const {
    SacConfig config;
    config.n_steps = 900;
    config.n_lanes = 2;
    config.learning_starts = 100;
    config.batch_size = 16;
    config.hidden = {8};
    config.eval_interval = 300;
    config.eval_episodes = 1;
    config.keep = KeptPolicy::kLast;
    NullSink log;
    return TrainAgent({.factory = PointMassFactory({.max_episode_steps = 5}),
                       .source = search,
                       .eval_parameters = {{1, 1, 0}},
                       .key = RngKey(5),
                       .folder = folder,
                       .run_name = "baselines/is/1",
                       .context = {&log, stop, 1},
                       .observer = observer},
                      config);
  }
};

TEST(IntervalSearch, AStoppedTrainingGoesOnToTheSameBytes) {
  const TestFolder whole, parts;
  const auto make = [] { return IntervalSearch(Space(), kStart, {.episodes = 3}, {-100, 0}); };
  IntervalSearch search = make();
  Training{whole.path()}(search);
  EXPECT_GT(search.High()[0], kStart[0]) << "the case needs an interval that moves";

  std::atomic<bool> stop = false;
  Training first{parts.path(), &stop, [&](int64_t, const Policy&, double) { stop = true; }};
  for (int k = 0; k < 2; ++k) {
    stop = false;
    IntervalSearch again = make();
    EXPECT_THROW(first(again), Interrupted);
  }
  IntervalSearch last = make();
  Training{parts.path()}(last);
  EXPECT_EQ(last.Low(), search.Low());
  EXPECT_EQ(last.High(), search.High());
  EXPECT_EQ(ReadFile(parts / "checkpoint.npz"), ReadFile(whole / "checkpoint.npz"));
}

TEST(IntervalSearch, OfDiscreteActionsTooAStoppedTrainingGoesOnToTheSameBytes) {
  const CorridorFactory factory;
  PpoConfig config;
  config.n_steps = 768;
  config.n_lanes = 2;
  config.rollout_steps = 64;
  config.n_epochs = 1;
  config.hidden = {8};
  config.eval_interval = 256;
  config.eval_episodes = 1;
  const auto train = [&](const std::filesystem::path& folder, const std::atomic<bool>* stop,
                         const EvaluationObserver& observe) {
    IntervalSearch search(factory.parameters(), {0.3}, {.episodes = 3}, {0, 1});
    NullSink log;
    TrainAgent({.factory = factory,
                .source = search,
                .eval_parameters = {{0.3}},
                .key = RngKey(5),
                .folder = folder,
                .run_name = "baselines/is/1",
                .context = {&log, stop, 1},
                .observer = observe},
               config);
    return std::pair(search.Low(), search.High());
  };
  const TestFolder whole, parts;
  const auto expected = train(whole.path(), nullptr, {});
  EXPECT_LT(expected.first[0], 0.3) << "the case needs an interval that moves";
  std::atomic<bool> stop = false;
  EXPECT_THROW(train(parts.path(), &stop, [&](int64_t, const Policy&, double) { stop = true; }), Interrupted);
  EXPECT_EQ(train(parts.path(), nullptr, {}), expected);
  EXPECT_EQ(ReadFile(parts / "checkpoint.npz"), ReadFile(whole / "checkpoint.npz"));
}

TEST(IntervalSearch, ACheckpointOfAnotherSpaceIsADataError) {
  const TestFolder folder;
  IntervalSearch search(Space(), kStart, {}, {});
  Training{folder.path()}(search);
  IntervalSearch other(ParameterSpace({Space()[0]}), {1.0}, {}, {});
  EXPECT_THROW(Training{folder.path()}(other), DataError);
}

TEST(ReturnScale, ATaskWithoutAScoreNeedsAReferenceAboveRandomActions) {
  const PointMassFactory factory;  // its returns are negative: random actions end a little away from zero
  EXPECT_THAT(MessageOf<UsageError>([&] { ScaleOf(factory, {}, kStart, RngKey(1)); }),
              testing::HasSubstr("baselines.is_reference"));
  EXPECT_THAT(MessageOf<UsageError>([&] { ScaleOf(factory, {.reference = -1e6}, kStart, RngKey(1)); }),
              testing::HasSubstr("random actions return"));
  const ReturnScale scale = ScaleOf(factory, {.reference = -0.01}, kStart, RngKey(1));
  EXPECT_LT(scale.random, -0.01);
  EXPECT_EQ(scale.Performance(scale.random), 0);
  EXPECT_EQ(scale.Performance(-0.01), 1);
}

}  // namespace oted::interval_search_test
