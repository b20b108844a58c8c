#include "oted/sim/episode_recorder.h"

#include <gtest/gtest.h>

#include "oted/sim/testing.h"

namespace oted::episode_recorder_test {

const BatchPolicy kPush = [](std::span<const double>, int, std::span<double> actions) {
  std::fill(actions.begin(), actions.end(), 0.7);
};

Dataset Record(const PointMassOptions& options, const std::vector<std::vector<double>>& z, LogPrecision precision,
               std::vector<EpisodeResult>* episodes = nullptr, int* n_diverged = nullptr) {
  PointMass simulator(options, static_cast<int>(z.size()), 1);
  EpisodeRecorder recorder(simulator.n_lanes(), precision);
  const auto results = RunEpisodes(simulator, z, kPush, RngKey(3), recorder.Observer());
  if (episodes != nullptr) *episodes = results;
  if (n_diverged != nullptr) *n_diverged = recorder.n_diverged();
  return recorder.Logs();
}

TEST(EpisodeRecorder, EveryLaneIsAnEpisodeWithItsReturnAndItsEnd) {
  std::vector<EpisodeResult> results;
  const Dataset logs = Record({.terminate_beyond = 1.4}, {{1, 1, 0}, {0.2, 1, 0}, {2, 1, 0}, {0.3, 1, 0}},
                              LogPrecision::kDouble, &results);
  logs.Check();
  const std::vector<Episode> episodes = logs.Episodes();
  ASSERT_EQ(episodes.size(), 4u);
  int n_terminated = 0;
  for (size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(episodes[k].size(), results[k].n_steps);
    EXPECT_EQ(episodes[k].terminated, results[k].end == LaneStatus::kTerminated);
    EXPECT_EQ(logs.EpisodeReturns()[k], results[k].episode_return);
    n_terminated += episodes[k].terminated;
    for (int i = episodes[k].begin; i + 1 < episodes[k].end; ++i) {
      EXPECT_EQ(logs.next_observations(i, 0), logs.observations(i + 1, 0));
    }
  }
  EXPECT_GT(n_terminated, 0);
  EXPECT_LT(n_terminated, 4);
}

TEST(EpisodeRecorder, FloatPrecisionRoundsObservationsAndRewardsAndNothingElse) {
  const std::vector<std::vector<double>> z = {{1, 1, 0}, {1.3, 0.6, 0}};
  const Dataset exact = Record({}, z, LogPrecision::kDouble), rounded = Record({}, z, LogPrecision::kFloat);
  ASSERT_EQ(exact.size(), rounded.size());
  const auto as_float = [](double v) { return static_cast<double>(static_cast<float>(v)); };
  int changed = 0;
  for (int i = 0; i < exact.size(); ++i) {
    for (int j = 0; j < 2; ++j) {
      EXPECT_EQ(rounded.observations(i, j), as_float(exact.observations(i, j)));
      EXPECT_EQ(rounded.next_observations(i, j), as_float(exact.next_observations(i, j)));
    }
    const size_t row = static_cast<size_t>(i);
    EXPECT_EQ(rounded.rewards[row], as_float(exact.rewards[row]));
    EXPECT_EQ(rounded.actions(i, 0), 0.7);
    changed += rounded.rewards[row] != exact.rewards[row];
  }
  EXPECT_GT(changed, 20);
}

TEST(EpisodeRecorder, ADivergedEpisodeIsCutBeforeTheBrokenStep) {
  std::vector<EpisodeResult> results;
  int n_diverged = 0;
  const Dataset logs =
      Record({.diverge_beyond = 1.4}, {{2, 1, 0}, {0.2, 1, 0}}, LogPrecision::kDouble, &results, &n_diverged);
  EXPECT_EQ(n_diverged, 1);
  ASSERT_EQ(results[0].end, LaneStatus::kDiverged);
  logs.Check();
  const std::vector<Episode> episodes = logs.Episodes();
  ASSERT_EQ(episodes.size(), 2u) << "the cut lane does not run into the next";
  EXPECT_EQ(episodes[0].size(), results[0].n_steps);
  EXPECT_FALSE(episodes[0].terminated);
  EXPECT_EQ(episodes[1].size(), 20);
}

TEST(EpisodeRecorder, ALaneThatDivergesAtOnceLeavesNothing) {
  std::vector<EpisodeResult> results;
  const Dataset logs = Record({.diverge_beyond = 0.0}, {{2, 1, 0}}, LogPrecision::kDouble, &results);
  EXPECT_EQ(results[0].n_steps, 0);
  EXPECT_EQ(logs.size(), 0);
}

}  // namespace oted::episode_recorder_test
