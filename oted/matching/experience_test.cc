#include "oted/matching/experience.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/matching/testing.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/episode_recorder.h"
#include "oted/sim/rollout.h"
#include "oted/sim/testing.h"

namespace oted::experience_test {

const std::vector<double> kTruth = {1.3, 0.6, 0.5};

/// Four 20-step episodes of the point mass at kTruth with wavering actions.
Dataset MakeDataset(const PointMassOptions& options = {}) {
  PointMass simulator(options, 4, 1);
  int step = 0;
  const auto act = [&](std::span<const double>, int n, std::span<double> actions) {
    for (int i = 0; i < n; ++i) actions[static_cast<size_t>(i)] = 0.9 * std::sin(1.7 * step + i);
    ++step;
  };
  EpisodeRecorder recorder(4);
  RunEpisodes(simulator, std::vector(4, kTruth), act, RngKey(1), recorder.Observer());
  return recorder.Logs();
}

std::vector<LaneExperience> Gather(const Dataset& dataset, const EvidenceConfig& config,
                                   const std::vector<std::vector<double>>& z, const TanhGaussianPolicy* clone = nullptr,
                                   const PointMassOptions& options = {}, int n_threads = 1) {
  ExperienceGatherer gatherer(std::make_unique<PointMass>(options, static_cast<int>(z.size()), n_threads), dataset,
                              clone, config);
  return gatherer.Gather(z, RngKey(2));
}

/// The dataset row that shows the same s and a, or -1.
int RowOf(const Dataset& dataset, std::span<const double> features) {
  for (int i = 0; i < dataset.size(); ++i) {
    if (dataset.observations(i, 0) == features[0] && dataset.observations(i, 1) == features[1] &&
        dataset.actions(i, 0) == features[2]) {
      return i;
    }
  }
  return -1;
}

TEST(DatasetFeatures, AreStateActionAndChange) {
  const Dataset dataset = MakeDataset();
  const Array2<double> with = DatasetFeatures(dataset, {}), without = DatasetFeatures(dataset, {.transitions = false});
  ASSERT_EQ(with.rows(), 80);
  ASSERT_EQ(with.cols(), 5);
  ASSERT_EQ(without.cols(), 3);
  for (int i = 0; i < 80; ++i) {
    EXPECT_EQ(with(i, 1), dataset.observations(i, 1));
    EXPECT_EQ(with(i, 2), dataset.actions(i, 0));
    EXPECT_EQ(with(i, 3), dataset.next_observations(i, 0) - dataset.observations(i, 0));
    EXPECT_EQ(with(i, 4), dataset.next_observations(i, 1) - dataset.observations(i, 1));
    EXPECT_EQ(without(i, 2), with(i, 2));
  }
}

TEST(ExperienceGatherer, ReplayAtTheTrueParametersGivesTheDatasetsTransitionsExactly) {
  const Dataset dataset = MakeDataset();
  const Array2<double> logged = DatasetFeatures(dataset, {});
  // The second lane has another gain, the third differs in a parameter without effect.
  const auto lanes = Gather(dataset, {.horizon = 6, .n_steps = 50}, {kTruth, {1.2, 0.6, 0.5}, {1.3, 0.6, 0.9}});
  ASSERT_EQ(lanes.size(), 3u);
  std::set<int> rows_seen;
  int different = 0;
  for (int i = 0; i < 50; ++i) {
    const auto features = lanes[0].features.row(i);
    const int row = RowOf(dataset, features);
    ASSERT_GE(row, 0) << i;
    rows_seen.insert(row);
    for (int j = 0; j < 5; ++j) EXPECT_EQ(features[static_cast<size_t>(j)], logged(row, j));
    different += std::abs(lanes[1].features(i, 4) - features[4]) > 1e-6;
  }
  EXPECT_GT(rows_seen.size(), 25u);
  EXPECT_GT(different, 45) << "another gain shows in the change of velocity";
  EXPECT_EQ(lanes[0].features, lanes[2].features);
  for (const LaneExperience& lane : lanes) {
    EXPECT_EQ(lane.features.rows(), 50);
    EXPECT_FALSE(lane.diverged);
  }
}

TEST(DatasetFeatures, ShowPastActionsOfTheSameEpisodeLatestFirst) {
  const Dataset dataset = MakeDataset();
  const Array2<double> features = DatasetFeatures(dataset, {.n_past_actions = 2});
  ASSERT_EQ(features.cols(), 7);
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin; i < episode.end; ++i) {
      EXPECT_EQ(features(i, 5), i > episode.begin ? dataset.actions(i - 1, 0) : 0.0);
      EXPECT_EQ(features(i, 6), i > episode.begin + 1 ? dataset.actions(i - 2, 0) : 0.0);
    }
  }
  EXPECT_EQ(DatasetFeatures(dataset, {.transitions = false, .n_past_actions = 2}).cols(), 3)
      << "the paper's g(s, a) sees no more";
}

TEST(ExperienceGatherer, ReplayAtTheTrueDelayGivesTheDatasetsTransitionsAndPastActions) {
  const auto factory = PointMassBehind("action/delay", 0, 3);
  const std::vector<double> truth = {1.3, 0.6, 0.5, 2};
  const Dataset dataset = RandomLogs(*factory->Make(4, 1), truth);
  ASSERT_EQ(factory->spec().n_past_actions, 3);
  const Array2<double> logged = DatasetFeatures(dataset, {.n_past_actions = 3});
  const EvidenceConfig config{.horizon = 3, .n_steps = 60, .n_past_actions = 3};
  ExperienceGatherer gatherer(factory->Make(2, 1), dataset, nullptr, config);
  const auto lanes = gatherer.Gather({truth, {1.3, 0.6, 0.5, 1}}, RngKey(2));
  int wrong = 0;
  for (int i = 0; i < 60; ++i) {
    // Actions are continuous: each names its row.
    int row = 0;
    while (row < dataset.size() && dataset.actions(row, 0) != lanes[0].features(i, 2)) ++row;
    ASSERT_LT(row, dataset.size());
    for (int j = 0; j < 8; ++j) EXPECT_NEAR(lanes[0].features(i, j), logged(row, j), 1e-12) << i << " " << j;
    wrong += std::abs(lanes[1].features(i, 4) - logged(row, 4)) > 1e-3;
  }
  EXPECT_GT(wrong, 55) << "a shorter delay shows in nearly every transition, the first of a replay included";
}

TEST(ExperienceGatherer, AllLanesGetTheSameStartsAndActionsWhateverTheirParameters) {
  const Dataset dataset = MakeDataset();
  const auto lanes = Gather(dataset, {.horizon = 5, .n_steps = 30}, {{0.5, 0.6, 0}, {2, 0.3, 0}, {1, 1, 0}});
  for (int i = 0; i < 30; ++i) {
    for (size_t k = 1; k < 3; ++k) {
      EXPECT_EQ(lanes[k].features(i, 2), lanes[0].features(i, 2));
      if (i % 5 != 0) continue;
      EXPECT_EQ(lanes[k].features(i, 0), lanes[0].features(i, 0));
      EXPECT_EQ(lanes[k].features(i, 1), lanes[0].features(i, 1));
    }
  }
}

TEST(ExperienceGatherer, TheClonesRolloutsRestartAtTheHorizonAndAfterTermination) {
  const Dataset dataset = MakeDataset();
  TanhGaussianPolicy clone(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  clone.net().parameters()[4] = 3.0f;    // mean of u: action near 1
  clone.net().parameters()[5] = -20.0f;  // log std: no noise
  const double action = std::tanh(3.0);
  const PointMassOptions options{.terminate_beyond = 0.9};
  const auto lanes = Gather(dataset, {.dataset_starts = false, .replayed_actions = false, .horizon = 8, .n_steps = 100},
                            {{1, 1, 0}, {2, 1, 0}}, &clone, options);
  for (size_t k = 0; k < 2; ++k) {
    const Array2<double>& f = lanes[k].features;
    ASSERT_EQ(f.rows(), 100) << "every z gets the same number of steps";
    int length = 0, short_ones = 0;
    for (int i = 0; i < 100; ++i) {
      EXPECT_NEAR(f(i, 2), action, 1e-6);
      EXPECT_NEAR(f(i, 3), 0.1 * (k == 0 ? 1 : 2) * action, 1e-6);
      ++length;
      const bool terminal = std::abs(f(i, 0) + f(i, 3)) > 0.9;
      if (i + 1 == 100) break;
      const bool fresh = f(i + 1, 1) == 0;  // a reset starts at rest, a running mass never is
      EXPECT_EQ(fresh, terminal || length == 8) << k << " " << i;
      short_ones += fresh && length < 8;
      if (fresh) length = 0;
    }
    EXPECT_GT(short_ones, 2);
  }
  EXPECT_EQ(lanes[0].features(0, 0), lanes[1].features(0, 0));
}

TEST(DatasetFeatures, FirstRowsAreThoseOfEachEpisodeThatARolloutReaches) {
  const Dataset dataset = MakeDataset();
  EvidenceConfig evidence{.transitions = false, .horizon = 3, .first_rows = true};
  const Array2<double> first = DatasetFeatures(dataset, evidence);
  int row = 0;
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin; i < std::min(episode.end, episode.begin + 3); ++i, ++row) {
      for (int j = 0; j < dataset.obs_dim(); ++j) EXPECT_EQ(first(row, j), dataset.observations(i, j));
    }
  }
  EXPECT_EQ(first.rows(), row);
  evidence.actions = false;
  EXPECT_EQ(DatasetFeatures(dataset, evidence).cols(), dataset.obs_dim()) << "s alone";
}

TEST(DatasetFeatures, AStackJoinsStepsOfOneEpisodeAndDropsWhatIsLeftOver) {
  const Dataset dataset = MakeDataset();
  const EvidenceConfig one{.transitions = false};
  EvidenceConfig stacked = one;
  stacked.stack = 3;
  const Array2<double> steps = DatasetFeatures(dataset, one), samples = DatasetFeatures(dataset, stacked);
  int row = 0;
  for (const Episode& episode : dataset.Episodes()) {
    for (int i = episode.begin; i + 3 <= episode.end; i += 3, ++row) {
      for (int k = 0; k < 3; ++k) {
        for (int j = 0; j < steps.cols(); ++j) EXPECT_EQ(samples(row, k * steps.cols() + j), steps(i + k, j));
      }
    }
  }
  EXPECT_EQ(samples.rows(), row);
  EXPECT_EQ(samples.cols(), 3 * steps.cols());
}

TEST(StepStack, PutsTheChannelsOfItsImagesSideBySide) {
  StepStack stack({.stack = 2, .image = {1, 2, 2}});  // two places of two channels, one number more
  Array2<double> samples;
  stack.Push(std::vector<double>{1, 2, 3, 4, 5}, samples);
  stack.Clear();  // another rollout
  stack.Push(std::vector<double>{11, 12, 13, 14, 15}, samples);
  EXPECT_EQ(samples.rows(), 0);
  stack.Push(std::vector<double>{21, 22, 23, 24, 25}, samples);
  ASSERT_EQ(samples.rows(), 1);
  const std::vector<double> wanted = {11, 12, 21, 22, 13, 14, 23, 24, 15, 25};
  EXPECT_TRUE(std::ranges::equal(samples.row(0), wanted));
}

TEST(FeatureShape, OfAStackFollowsItsRows) {
  SimulatorSpec spec;
  spec.observation_shape = {5};
  spec.image_shape = {1, 2, 2};
  spec.observation_levels = {11, 6, 11, 6, 4};
  spec.act_dim = 1;
  spec.n_discrete_actions = 3;
  const EvidenceConfig evidence{.transitions = false, .stack = 2, .image = spec.image_shape};
  const InputShape shape = FeatureShape(spec, evidence);
  EXPECT_EQ(shape.image, (std::vector<int>{1, 2, 4}));
  EXPECT_EQ(shape.levels, (std::vector<int>{11, 6, 11, 6, 11, 6, 11, 6, 4, 3, 4, 3}));
  EXPECT_THROW(FeatureShape(spec, EvidenceConfig{}), UsageError) << "differences of kinds mean nothing";
}

TEST(FeatureShape, OfDiscreteActionsHasIndicesForThemAloneAndForThoseBefore) {
  SimulatorSpec spec;
  spec.observation_shape = {2};
  spec.act_dim = 1;
  spec.n_discrete_actions = 3;
  const EvidenceConfig evidence{.n_past_actions = 2};
  EXPECT_EQ(FeatureShape(spec, evidence).levels, (std::vector<int>{0, 0, 3, 0, 0, 3, 3})) << "s, a, s' - s, two before";
  Dataset logs;
  logs.observations = Array2<double>(1, 2), logs.next_observations = Array2<double>(1, 2);
  logs.actions = Array2<double>(1, 1);
  logs.terminals = {0}, logs.timeouts = {1};
  EXPECT_EQ(DatasetFeatures(logs, evidence).cols(), 7);
}

TEST(ExperienceGatherer, ClonesNoiseIsScaled) {
  const Dataset dataset = MakeDataset();
  TanhGaussianPolicy clone(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  clone.net().parameters()[5] = -1.0f;
  const auto deviation = [&](double scale) {
    const auto lanes =
        Gather(dataset, {.replayed_actions = false, .n_steps = 500, .clone_noise = scale}, {kTruth}, &clone);
    double squares = 0;
    for (int i = 0; i < 500; ++i) squares += std::pow(std::atanh(lanes[0].features(i, 2)), 2) / 500;
    return std::sqrt(squares);
  };
  EXPECT_NEAR(deviation(1.0), std::exp(-1), 0.05);
  EXPECT_NEAR(deviation(0.5), 0.5 * std::exp(-1), 0.03);
  EXPECT_EQ(deviation(0.0), 0);
}

TEST(ExperienceGatherer, TheClonesNoiseIsTheSameInAllLanesUnlessEachHasItsOwnStarts) {
  const Dataset dataset = MakeDataset();
  TanhGaussianPolicy clone(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  clone.net().parameters()[5] = -1.0f;
  EvidenceConfig evidence{.replayed_actions = false, .horizon = 7, .n_steps = 30};
  // The third lane ends its rollouts early; the next ones still begin and act as those of the others.
  const PointMassOptions options{.terminate_beyond = 0.6};
  const std::vector<std::vector<double>> z = {kTruth, kTruth, {2, 1, 0}};
  const auto common = Gather(dataset, evidence, z, &clone, options);
  EXPECT_EQ(common[0].features, common[1].features);
  EXPECT_EQ(common[0].features(0, 2), common[2].features(0, 2));
  EXPECT_NE(common[0].features(0, 2), common[0].features(1, 2)) << "it is noise";
  evidence.common_starts = false;
  const auto own = Gather(dataset, evidence, z, &clone, options);
  EXPECT_NE(own[0].features(0, 2), own[1].features(0, 2));
}

TEST(ExperienceGatherer, TheCloneMayBeginWhereTheTaskSoonEndsButNotWhereTheLogWasCut) {
  Dataset dataset = MakeDataset();
  dataset.terminals[19] = 1;  // the first of four episodes of 20 steps; the others were cut
  dataset.timeouts[19] = 0;
  TanhGaussianPolicy clone(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  const auto windows = [&](bool replayed) {
    const ExperienceGatherer gatherer(std::make_unique<PointMass>(PointMassOptions{}, 1, 1), dataset, &clone,
                                      {.replayed_actions = replayed, .horizon = 6});
    return gatherer.windows();
  };
  EXPECT_EQ(windows(true).size(), 4u * 15) << "a replay ends with the log";
  const std::vector<LogWindow> of_clone = windows(false);
  ASSERT_EQ(of_clone.size(), 20u + 3 * 15);
  EXPECT_EQ(of_clone[19].begin, 19);
  EXPECT_EQ(of_clone[19].n_steps, 1) << "of the log; the clone's rollout may be longer";
}

TEST(ExperienceGatherer, ADivergingLaneIsMarkedAndItsBrokenStepsAreLeftOut) {
  const Dataset dataset = MakeDataset();
  const PointMassOptions options{.diverge_beyond = 1.6};
  TanhGaussianPolicy clone(Normalizer{{0, 0}, {1, 1}}, {}, {-1}, {1});
  clone.net().parameters()[4] = 10.0f;
  const auto lanes = Gather(dataset, {.dataset_starts = false, .replayed_actions = false, .horizon = 10, .n_steps = 60},
                            {{0.2, 1, 0}, {2, 1, 0}, {0.3, 1, 0}}, &clone, options);
  EXPECT_FALSE(lanes[0].diverged);
  EXPECT_TRUE(lanes[1].diverged);
  EXPECT_FALSE(lanes[2].diverged);
  EXPECT_EQ(lanes[0].features.rows(), 60);
  EXPECT_LT(lanes[1].features.rows(), 60);
  EXPECT_GT(lanes[1].features.rows(), 0);
  for (const double v : lanes[1].features.values()) EXPECT_TRUE(std::isfinite(v));
  // The neighbours do not notice.
  const auto without =
      Gather(dataset, {.dataset_starts = false, .replayed_actions = false, .horizon = 10, .n_steps = 60},
             {{0.2, 1, 0}, {0.5, 1, 0}, {0.3, 1, 0}}, &clone, options);
  EXPECT_EQ(lanes[0].features.rows(), without[0].features.rows());
}

TEST(ExperienceGatherer, StatesThatTheObservationDoesNotDetermineAreNoStarts) {
  const Dataset dataset = MakeDataset();
  const double clip = 0.5;
  const auto lanes = Gather(dataset, {.horizon = 1, .n_steps = 200}, {kTruth}, nullptr, {.velocity_clip = clip});
  for (int i = 0; i < 200; ++i) EXPECT_LT(std::abs(lanes[0].features(i, 1)), clip);
  const Dataset fast = [&] {
    Dataset d = dataset;
    for (int i = 0; i < d.size(); ++i) d.observations(i, 1) = 1;
    return d;
  }();
  MessageOf<DataError>([&] { Gather(fast, {}, {kTruth}, nullptr, {.velocity_clip = clip}); });
}

TEST(ExperienceGatherer, ASimulatorWithoutSettableStatesIsADataErrorWithTheRemedy) {
  const Dataset dataset = MakeDataset();
  const std::string message =
      MessageOf<DataError>([&] { Gather(dataset, {}, {kTruth}, nullptr, {.can_set_state = false}); });
  EXPECT_NE(message.find("--set design.adversarial.starts=initial"), std::string::npos) << message;
}

TEST(ExperienceGatherer, StepsThatAreKeptAreTheRolloutsOneAfterTheOther) {
  const Dataset dataset = MakeDataset();
  EvidenceConfig evidence{.horizon = 4, .n_steps = 12};
  evidence.keep_steps = true;
  const auto lanes = Gather(dataset, evidence, {kTruth}, nullptr, {});
  const Dataset& steps = lanes[0].steps;
  ASSERT_EQ(steps.size(), 12);
  const std::vector<Episode> rollouts = steps.Episodes();
  ASSERT_EQ(rollouts.size(), 3u);
  for (int i = 0; i < 12; ++i) {
    for (int j = 0; j < 2; ++j) {
      EXPECT_EQ(steps.observations(i, j), lanes[0].features(i, j));
      EXPECT_NEAR(steps.next_observations(i, j) - steps.observations(i, j), lanes[0].features(i, 3 + j), 1e-12);
      if (i % 4 == 3) continue;
      EXPECT_EQ(steps.next_observations(i, j), steps.observations(i + 1, j));
    }
  }
  evidence.keep_steps = false;
  EXPECT_EQ(Gather(dataset, evidence, {kTruth}, nullptr, {})[0].steps.size(), 0);
}

TEST(ExperienceGatherer, TheSameKeyGivesTheSameExperienceAtAnyThreadCount) {
  const Dataset dataset = MakeDataset();
  const std::vector<std::vector<double>> z = {{1, 1, 0}, {0.5, 0.4, 0}, {1.7, 1, 0}};
  const auto one = Gather(dataset, {}, z, nullptr, {}, 1), two = Gather(dataset, {}, z, nullptr, {}, 2);
  for (size_t k = 0; k < 3; ++k) EXPECT_EQ(one[k].features, two[k].features);
}

}  // namespace oted::experience_test
