#include "oted/rl/offline/offline_rows.h"

#include <gtest/gtest.h>

#include <map>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/sim/testing.h"

namespace oted::offline_rows_test {

/// Row i: s = i, s' = i + 1, a = 2 i / 10 in a range of [0, 2], r = 10 i. Episodes 0-2 (terminal), 3-5 (time limit).
Dataset Logs() {
  Dataset logs;
  for (int i = 0; i < 6; ++i) {
    logs.observations.AppendRow(std::vector<double>{1.0 * i, 0});
    logs.next_observations.AppendRow(std::vector<double>{1.0 * i + 1, 0});
    logs.actions.AppendRow(std::vector<double>{0.2 * i});
    logs.rewards.push_back(10 * i);
    logs.terminals.push_back(i == 2);
    logs.timeouts.push_back(i == 5);
  }
  return logs;
}

/// What is drawn, by its state.
std::map<float, OfflineBatch> Drawn(const OfflineRows& rows) {
  std::map<float, OfflineBatch> found;
  Rng rng(1);
  for (int i = 0; i < 200; ++i) {
    OfflineBatch batch;
    rows.Draw(1, rng, batch);
    found[batch.observations[0]] = batch;
  }
  return found;
}

const Normalizer kRaw = {{0, 0}, {1, 1}};

TEST(OfflineRows, ATimeLimitIsNoEndAndNoEpisodeRunsIntoTheNext) {
  const SimulatorSpec spec = PointMass::MakeSpec({.action_low = 0, .action_high = 2});
  const OfflineRows rows(Logs(), spec, kRaw, OfflineRowChoice::kAll);
  EXPECT_EQ(rows.size(), 6);
  const auto drawn = Drawn(rows);
  ASSERT_EQ(drawn.size(), 6u);
  for (const auto& [state, batch] : drawn) {
    const int i = static_cast<int>(state);
    EXPECT_EQ(batch.observations[2], state + 1);
    EXPECT_EQ(batch.joint[0], state);
    EXPECT_NEAR(batch.joint[2], 0.2 * i - 1, 1e-6) << "on [-1, 1]";
    EXPECT_EQ(batch.rewards[0], 10 * i);
    EXPECT_EQ(batch.terminated[0], i == 2 ? 1 : 0);
    const bool has_next = i != 2 && i != 5;
    EXPECT_NEAR(batch.next_actions[0], has_next ? 0.2 * (i + 1) - 1 : 0, 1e-6);
  }
}

TEST(OfflineRows, RowsWithoutANextActionAndThoseNotAskedForAreLeftOut) {
  const SimulatorSpec spec = PointMass::MakeSpec({.action_low = 0, .action_high = 2});
  const auto drawn = Drawn(OfflineRows(Logs(), spec, kRaw, OfflineRowChoice::kWithNextAction));
  EXPECT_EQ(drawn.size(), 5u);
  EXPECT_TRUE(drawn.contains(2)) << "terminal: no next action is needed";
  EXPECT_FALSE(drawn.contains(5));
  EXPECT_EQ(Drawn(OfflineRows(Logs(), spec, kRaw, OfflineRowChoice::kAll, {1, 4})).size(), 2u);
  const Normalizer units{{1, 0}, {2, 1}};
  EXPECT_TRUE(Drawn(OfflineRows(Logs(), spec, units, OfflineRowChoice::kAll, {4})).contains(1.5f));
}

TEST(OfflineRows, LogsWithoutRewardsAreADataError) {
  Dataset logs = Logs();
  logs.rewards.clear();
  EXPECT_NE(MessageOf<DataError>([&] {
              OfflineRows(logs, PointMass::MakeSpec({}), kRaw, OfflineRowChoice::kAll);
            }).find("no rewards"),
            std::string::npos);
}

}  // namespace oted::offline_rows_test
