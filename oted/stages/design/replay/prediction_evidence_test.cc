#include "oted/stages/design/replay/prediction_evidence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"
#include "oted/matching/verdict.h"
#include "oted/sim/testing.h"
#include "oted/stages/design/replay/excess.h"
#include "oted/stages/design/replay/noise_estimate.h"
#include "oted/stages/design/replay/prediction_ratios.h"
#include "oted/stages/design/testing.h"

namespace oted::prediction_evidence_test {

using Eigen::VectorXd;

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

/// Of these logs, judged at z, whose guess of the noise is `guess`. Every interval has to be borne out.
HeldOutPrediction Evidence(const Dataset& logs, const std::vector<double>& z, double guess, uint64_t seed,
                           const SimulatorFactory& factory = PointMassFactory(),
                           const std::vector<std::vector<double>>& as_likely = {}, bool noise_of_other_logs = false) {
  const VectorXd guessed = VectorXd::Constant(2, guess);
  const ReadingModel readings = ReadingModel::Of(factory.spec(), logs);
  const auto prediction = PredictLogs({.factory = factory,
                                       .kept_aside = logs,
                                       .learned = nullptr,
                                       .z = z,
                                       .noise = guessed,
                                       .readings = readings,
                                       .narrow = {0, 1, 2},
                                       .key = RngKey(seed + 100),
                                       .n_threads = 1,
                                       .noise_of_other_logs = noise_of_other_logs,
                                       .as_likely = as_likely});
  OTED_CHECK(prediction.has_value());
  return *prediction;
}

/// Of noisy logs that the simulator at the truth made.
HeldOutPrediction Evidence(const std::vector<double>& z, double noise, double guess, uint64_t seed) {
  const Dataset clean = PointMassLogs(kTruth, 25);
  return Evidence(noise > 0 ? WithSensorNoise(clean, noise, RngKey(seed)) : clean, z, guess, seed);
}

TEST(PredictLogs, TheTruthReachesTheFloorAtAnyNoiseAndFromAWrongGuessOfIt) {
  int n_reached = 0;
  for (const auto& [noise, guess] : {std::pair(0.0, 1e-8), {0.02, 0.02}, {0.1, 0.1}, {0.05, 0.1}, {0.05, 0.04}}) {
    for (uint64_t seed = 1; seed <= 4; ++seed) {
      const HeldOutPrediction prediction = Evidence(kTruth, noise, guess, seed);
      EXPECT_EQ(prediction.horizons.size(), 3u);
      EXPECT_TRUE(ChannelsOff(prediction).empty()) << noise << " guessed " << guess << ", seed " << seed;
      EXPECT_TRUE(PredictsBetter(prediction));
      n_reached += ReachesFloor(prediction) ? 1 : 0;
    }
  }
  EXPECT_GE(n_reached, 16) << "of 20: few windows need not tell it";
}

TEST(PredictLogs, NoiseThatOtherLogsToldIsNoBoundForThese) {
  const PointMassFactory factory;
  int n_reached = 0;
  for (const auto& [noise, of_others] : {std::pair(0.0, 0.05), {0.05, 1e-9}, {0.05, 0.005}, {0.1, 0.01}, {0.02, 0.1}}) {
    for (uint64_t seed = 1; seed <= 4; ++seed) {
      const Dataset clean = PointMassLogs(kTruth, 25);
      const Dataset logs = noise > 0 ? WithSensorNoise(clean, noise, RngKey(seed)) : clean;
      const HeldOutPrediction prediction = Evidence(logs, kTruth, of_others, seed, factory, {}, true);
      EXPECT_TRUE(ChannelsOff(prediction).empty()) << noise << ", others " << of_others << ", seed " << seed;
      n_reached += ReachesFloor(prediction) ? 1 : 0;
      const std::vector<double> off = {1.2, 0.6, 0.5};
      if (noise > 0.02) continue;
      EXPECT_FALSE(ReachesFloor(Evidence(logs, off, of_others, seed, factory, {}, true)))
          << "an error is no noise: " << noise << ", others " << of_others << ", seed " << seed;
    }
  }
  EXPECT_GE(n_reached, 16) << "of 20: few windows need not tell it";
}

TEST(PredictLogs, FewRowsTellTheFloorRoughly) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 25), 0.05, RngKey(1));
  const PointMassFactory factory;
  const ReadingModel readings = ReadingModel::Of(factory.spec(), logs);
  const VectorXd noise = VectorXd::Constant(2, 0.05);
  const auto excess = [&](int noise_rows) {
    const auto prediction = PredictLogs({.factory = factory,
                                         .kept_aside = logs,
                                         .learned = nullptr,
                                         .z = kTruth,
                                         .noise = noise,
                                         .readings = readings,
                                         .narrow = {},
                                         .key = RngKey(1),
                                         .noise_rows = noise_rows});
    return prediction->horizons[0];
  };
  const HeldOutPrediction::Horizon certain = excess(0), few = excess(50);
  EXPECT_EQ(few.excess.value, certain.excess.value);
  // The state is what is read: windows of three rows leave the freedom of two, and so many rows have half as many.
  const double of_noise = std::pow(std::sqrt(5.44 / 50) - 0.1, 2);
  EXPECT_NEAR(few.channels[0].excess.error, std::sqrt(std::pow(certain.channels[0].excess.error, 2) + of_noise), 1e-12);
  EXPECT_NEAR(few.excess.error, std::sqrt(std::pow(certain.excess.error, 2) + of_noise / 2), 1e-12)
      << "the mean of two channels";
  EXPECT_EQ(excess(600).excess.error, certain.excess.error);
}

TEST(PredictLogs, AFaultInOneOfFiveEpisodesLeavesNoFloorThatIsReachedAndIsNamed) {
  const Dataset sound = WithSensorNoise(PointMassLogs(kTruth, 25), 0.02, RngKey(1));
  const std::vector<Episode> episodes = sound.Episodes();
  ASSERT_GE(episodes.size(), 4u);
  Dataset cut = sound;  // the commands of an episode did not arrive
  for (int row = episodes[2].begin; row < episodes[2].end; ++row) {
    for (double& action : cut.actions.row(row)) action = -action;
  }
  const PointMassFactory factory;
  EXPECT_TRUE(ToldOf(Evidence(sound, kTruth, 0.02, 1, factory, {}).horizons).odd_episodes.empty());
  const HeldOutPrediction prediction = Evidence(cut, kTruth, 0.02, 1, factory, {});
  EXPECT_FALSE(ReachesFloor(prediction));
  EXPECT_EQ(ToldOf(prediction.horizons).odd_episodes, std::vector<int>{2});
}

TEST(FindOddEpisodes, TheFarthestOffIsTheFirst) {
  const std::map<int, std::vector<double>> excess = {
      {0, {0, 0.1}}, {1, {2, 2.1}}, {2, {0.1, 0}}, {3, {4, 4.2}}, {4, {0.1, 0.1}}};
  EXPECT_THAT(FindOddEpisodes(excess).numbers, testing::ElementsAre(3, 1));
}

TEST(FindOddEpisodes, AreFarOffOrSurelyFartherThanTheOthers) {
  const auto around = [](double mean) {
    return std::vector<double>{mean - 0.3, mean - 0.1, mean, mean + 0.1, mean + 0.3};
  };
  std::map<int, std::vector<double>> excess = {{0, around(0)}, {1, around(0.1)}, {2, around(1.0)}, {3, around(-0.1)}};
  const auto find = [&](std::vector<double> of_second) {
    excess[2] = std::move(of_second);
    return FindOddEpisodes(excess);
  };
  EXPECT_THAT(find(around(1.0)).numbers, testing::ElementsAre(2));
  EXPECT_TRUE(find(around(1.0)).surely);
  EXPECT_THAT(find(around(0.6)).numbers, testing::IsEmpty()) << "not 1.4 times the floor's error";
  EXPECT_THAT(find({1.0}).numbers, testing::IsEmpty()) << "no standard error";
  for (const std::vector<double>& by_chance : {std::vector<double>{-1.5, 0, 6}, {1.5}}) {
    EXPECT_THAT(find(by_chance).numbers, testing::ElementsAre(2));
    EXPECT_FALSE(find(by_chance).surely) << "one window";
  }
  for (auto& [unused, of] : excess) of = {1.5};
  EXPECT_THAT(FindOddEpisodes(excess).numbers, testing::IsEmpty()) << "all are";
}

TEST(PredictLogs, WhatAFewWindowsOfAllRecordingsShowIsNotTheFloor) {
  const PointMassFactory factory;
  const auto in_some = [&](const Dataset& logs) {
    const HeldOutPrediction prediction = Evidence(logs, kTruth, 0.02, 1, factory, {});
    const auto is_it = [](const HeldOutPrediction::Channel& channel) { return channel.in_some; };
    return std::ranges::any_of(prediction.horizons,
                               [&](const auto& horizon) { return std::ranges::any_of(horizon.channels, is_it); });
  };
  int n_by_chance = 0;
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    n_by_chance += in_some(WithSensorNoise(PointMassLogs(kTruth, 25), 0.02, RngKey(seed))) ? 1 : 0;
  }
  EXPECT_EQ(n_by_chance, 0);
  Dataset pushed = WithSensorNoise(PointMassLogs(kTruth, 25), 0.02, RngKey(1));  // in every sixth episode, once
  const std::vector<Episode> episodes = pushed.Episodes();
  for (size_t e = 0; e < episodes.size(); e += 6) {
    const int row = (episodes[e].begin + episodes[e].end) / 2;
    pushed.actions(row, 0) = -3 * pushed.actions(row, 0);
  }
  const HeldOutPrediction prediction = Evidence(pushed, kTruth, 0.02, 1, factory, {});
  EXPECT_FALSE(ReachesFloor(prediction));
  EXPECT_TRUE(in_some(pushed));
  for (const auto& horizon : prediction.horizons) {
    EXPECT_GT(horizon.channels[0].floor, 0.015) << "noise of 0.02 is on every reading, whatever the pushes did";
  }
}

TEST(PredictLogs, TellsHowFarItIsAndStopsWhereItIsTold) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 25), 0.05, RngKey(1));
  const PointMassFactory factory;
  const ReadingModel readings = ReadingModel::Of(factory.spec(), logs);
  const VectorXd noise = VectorXd::Constant(2, 0.05);
  const auto predict = [&](const std::vector<double>& z, const std::function<void(int, int)>& tell) {
    return PredictLogs({.factory = factory,
                        .kept_aside = logs,
                        .learned = nullptr,
                        .z = z,
                        .noise = noise,
                        .readings = readings,
                        .narrow = {0, 1},
                        .key = RngKey(1),
                        .tell = tell});
  };
  // A design that predicts no better than the nominal simulator has the floor of that as well.
  for (const std::vector<double>& z : {kTruth, factory.parameters().Nominal()}) {
    std::vector<int> done, total;
    predict(z, [&](int d, int t) {
      done.push_back(d);
      total.push_back(t);
    });
    ASSERT_GT(done.size(), 5u);
    for (size_t i = 0; i < done.size(); ++i) {
      EXPECT_EQ(done[i], static_cast<int>(i) + 1);
      EXPECT_EQ(total[i], total.front()) << "a bar that goes back";
    }
    EXPECT_LE(done.back(), total.back());
    EXPECT_GE(done.back(), total.back() - 4) << "rounds of the noise that were not needed, two for each simulator";
  }
  const auto stop = [](int done, int) {
    if (done == 2) throw Interrupted();
  };
  EXPECT_THROW(predict(kTruth, stop), Interrupted);
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

TEST(PredictLogs, WhatIsUnknownOfTheParametersIsPartOfTheFloor) {
  const std::vector<double> off = {1.35, 0.6, 0.5};
  const std::vector<std::vector<double>> as_likely = {{1.2, 0.6, 0.5}, {1.25, 0.6, 0.5}, {1.3, 0.6, 0.5},
                                                      {1.4, 0.6, 0.5}, {1.45, 0.6, 0.5}, {1.5, 0.6, 0.5}};
  const PointMassFactory factory;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 25), 0.02, RngKey(seed));
    EXPECT_TRUE(ChannelsOff(Evidence(logs, off, 0.02, seed, factory, as_likely)).empty()) << seed;
    const HeldOutPrediction certain = Evidence(logs, off, 0.02, seed);
    EXPECT_FALSE(ReachesFloor(certain)) << seed;
    EXPECT_EQ(Evidence(logs, off, 0.02, seed, factory, {off, off}).horizons[0].excess.value,
              certain.horizons[0].excess.value);
    // A gain that is off by two thirds no such doubt explains.
    EXPECT_FALSE(ReachesFloor(Evidence(logs, {0.5, 0.6, 0.5}, 0.02, seed, factory,
                                       {{0.4, 0.6, 0.5}, {0.45, 0.6, 0.5}, {0.55, 0.6, 0.5}, {0.6, 0.6, 0.5}})))
        << seed;
  }
}

TEST(PredictionRatios, DrawsThatDifferByAFactorScatterByItsLogarithm) {
  const JudgedChannels channels{.spread = VectorXd::Constant(2, 1e6), .weight = VectorXd::Constant(2, 0.5)};
  std::vector<Eigen::MatrixXd> draws;
  for (const double log_ratio : {-1.0, 0.0, 1.0}) {
    draws.push_back(Eigen::MatrixXd::Constant(2, 20, 1e9 * std::exp(log_ratio)));
    draws.back().row(1).setConstant(1e9);
  }
  // Standard deviations 1 and 0, of one more draw about the mean of three.
  const VectorXd scatter = ScatterOfDraws(draws, channels);
  EXPECT_NEAR(scatter[0], std::sqrt(4.0 / 3), 2e-3);
  EXPECT_NEAR(scatter[1], 0, 1e-12);
  EXPECT_NEAR(scatter[2], 0.5 * scatter[0], 1e-12) << "both channels together";
  draws.pop_back();
  EXPECT_EQ(ScatterOfDraws(draws, channels), VectorXd::Zero(3)) << "two draws do not tell";
}

/// Of the truth, under slow actions.
Dataset SlowLogs() {
  PointMassOptions options;
  options.max_episode_steps = 60;
  PointMass simulator(options, 1, 1);
  simulator.SetParameters(0, kTruth);
  Rng rng(1);
  Dataset logs;
  for (int row = 0; row < 20 * 60; ++row) {
    if (row % 60 == 0) simulator.Reset(0, rng);
    const std::vector<double> action = {std::sin(0.15 * row)};
    const int lane = 0;
    logs.observations.AppendRow(simulator.observation(0));
    logs.actions.AppendRow(action);
    simulator.Step({&lane, 1}, action);
    logs.next_observations.AppendRow(simulator.observation(0));
    logs.terminals.push_back(0);
    logs.timeouts.push_back(row % 60 == 59);
  }
  return logs;
}

TEST(PredictLogs, ADesignThatIsOffDoesNotRaiseTheFloor) {
  // Its short windows leave its errors, which then pass for noise. Readings of slow motion tell that it is not.
  const Dataset logs = WithSensorNoise(SlowLogs(), 0.02, RngKey(1));
  const HeldOutPrediction at_truth = Evidence(logs, kTruth, 0.02, 1), off = Evidence(logs, {0.3, 0.6, 0.5}, 0.2, 1);
  EXPECT_FALSE(ReachesFloor(off));
  for (size_t h = 0; h < 3; ++h) {
    for (size_t c = 0; c < 2; ++c) {
      EXPECT_LT(off.horizons[h].channels[c].floor, 2 * at_truth.horizons[h].channels[c].floor) << h << c;
    }
  }
}

TEST(PredictLogs, ADesignThatCannotPredictItsOwnLogsDoesNotReachTheFloor) {
  // It bounces off walls that the logs' own simulator, the nominal one, hardly ever meets.
  const BetweenWallsFactory factory;
  const std::vector<double> nominal = factory.parameters().Nominal();
  BetweenWalls simulator(25, 1);
  const Dataset logs = WithSensorNoise(RandomLogs(simulator, nominal), 0.05, RngKey(1));
  const HeldOutPrediction off = Evidence(logs, {2.0, 0.2, 0.5}, 0.05, 1, factory);
  EXPECT_FALSE(PredictsBetter(off));
  EXPECT_FALSE(ReachesFloor(off));
}

std::vector<std::pair<int, bool>> OpenEnds(const HeldOutPrediction& prediction) {
  std::vector<std::pair<int, bool>> ends;
  for (const HeldOutPrediction::OpenEnd& end : prediction.open_ends) ends.emplace_back(end.parameter, end.above);
  return ends;
}

TEST(PredictLogs, OnlyWhatPredictionsTellLeavesNoEndOpen) {
  // Gain and damping move the point mass; the third parameter moves nothing.
  const std::vector<std::pair<int, bool>> third = {{2, false}, {2, true}};
  for (const double noise : {0.0, 0.02}) EXPECT_EQ(OpenEnds(Evidence(kTruth, noise, std::max(noise, 1e-8), 1)), third);
}

TEST(PredictLogs, AtRestEveryEndIsOpen) {
  Dataset still = PointMassLogs(kTruth, 25);
  for (Array2<double>* of : {&still.observations, &still.next_observations, &still.actions}) {
    std::ranges::fill(of->values(), 0.0);
  }
  still.qpos = still.qvel = {};
  const Dataset logs = WithSensorNoise(still, 0.02, RngKey(1));
  const std::vector<double> middle = {1.0, 0.6, 0.5};
  const std::vector<std::pair<int, bool>> all = {{0, false}, {0, true}, {1, false}, {1, true}, {2, false}, {2, true}};
  EXPECT_EQ(OpenEnds(Evidence(logs, middle, 0.02, 1)), all);
}

TEST(PredictLogs, AFewWindowsThatGoWrongDoNotHideWhatAllOthersShow) {
  // Noise puts some starts beyond a wall: what is lost there is the same by chance, whatever the damping is.
  const BetweenWallsFactory factory;
  const std::vector<double> z = {1.7, 0.3, 0.5};
  BetweenWalls simulator(25, 1);
  const Dataset clean = RandomLogs(simulator, z);
  const std::vector<std::pair<int, bool>> third = {{2, false}, {2, true}};
  for (const uint64_t seed : {1, 2, 3}) {
    EXPECT_EQ(OpenEnds(Evidence(WithSensorNoise(clean, 0.05, RngKey(seed)), z, 0.05, seed, factory)), third) << seed;
  }
}

TEST(PredictLogs, WhatTheLogsKeptAsideDoNotShowTheOthersMay) {
  Dataset still = PointMassLogs(kTruth, 5);
  for (Array2<double>* of : {&still.observations, &still.next_observations, &still.actions}) {
    std::ranges::fill(of->values(), 0.0);
  }
  still.qpos = still.qvel = {};
  const Dataset kept_aside = WithSensorNoise(still, 0.02, RngKey(1));
  const Dataset moving = WithSensorNoise(PointMassLogs(kTruth, 20), 0.02, RngKey(2));
  const PointMassFactory factory;
  const ReadingModel readings = ReadingModel::Of(factory.spec(), moving);
  const VectorXd noise = VectorXd::Constant(2, 0.02);
  const auto prediction = PredictLogs({.factory = factory,
                                       .kept_aside = kept_aside,
                                       .learned = &moving,
                                       .z = kTruth,
                                       .noise = noise,
                                       .readings = readings,
                                       .narrow = {0, 1, 2},
                                       .key = RngKey(1),
                                       .n_threads = 1});
  const std::vector<std::pair<int, bool>> third = {{2, false}, {2, true}};
  EXPECT_EQ(OpenEnds(prediction.value()), third);
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
                            .narrow = {},
                            .key = RngKey(1),
                            .n_threads = 1}));
}

TEST(PredictLogs, WholeRecordingsAreToldApartFromPartsOfThoseThatWereLearnedFrom) {
  // The first two are of the nominal simulator, the eight others of the one that the design found.
  const PointMassFactory factory;
  Dataset logs = PointMassLogs(factory.parameters().Nominal(), 2);
  logs.Append(PointMassLogs(kTruth, 8));
  const ReadingModel readings = ReadingModel::Of(factory.spec(), logs);
  const VectorXd noise = VectorXd::Constant(2, 1e-8);
  const auto predict = [&](int n_whole) {
    return PredictLogs({.factory = factory,
                        .kept_aside = logs,
                        .learned = &logs,
                        .z = kTruth,
                        .noise = noise,
                        .readings = readings,
                        .narrow = {},
                        .key = RngKey(1),
                        .n_threads = 1,
                        .n_whole = n_whole})
        .value();
  };
  const HeldOutPrediction mixed = predict(2);
  EXPECT_EQ(mixed.n_recordings, 2);
  EXPECT_EQ(mixed.n_parts, 8);
  EXPECT_GT(mixed.horizons[0].gain.value, 0);
  EXPECT_LT(mixed.horizons[0].gain_of_recordings.value, 0);
  EXPECT_GT(mixed.horizons[0].n_of_recordings, 0);
  EXPECT_LT(mixed.horizons[0].n_of_recordings, mixed.horizons[0].n_windows);
  EXPECT_EQ(predict(10).horizons[0].n_of_recordings, 0) << "all are: the gain is theirs";
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
