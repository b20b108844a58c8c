#include "oted/matching/held_out.h"

#include <gtest/gtest.h>

#include <set>

#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::held_out_test {

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

TEST(HoldOut, WholeEpisodesJudgeAndNoRowDoesBoth) {
  const Dataset logs = PointMassLogs(kTruth, 6);
  const HeldOutParts parts = HoldOut(logs, RngKey(1));
  EXPECT_EQ(parts.judge.Episodes().size(), 1u);
  EXPECT_EQ(parts.learn.Episodes().size(), 5u);
  EXPECT_EQ(parts.learn.size() + parts.judge.size(), logs.size());
  std::set<double> learned;
  for (int i = 0; i < parts.learn.size(); ++i) learned.insert(parts.learn.actions(i, 0));
  for (int i = 0; i < parts.judge.size(); ++i) EXPECT_FALSE(learned.contains(parts.judge.actions(i, 0))) << i;
}

TEST(HoldOut, OfOneEpisodeTheEndJudges) {
  const Dataset logs = PointMassLogs(kTruth, 1);
  const HeldOutParts parts = HoldOut(logs, RngKey(1));
  const int n_learn = parts.learn.size();
  EXPECT_EQ(n_learn, static_cast<int>(0.8 * logs.size()));
  EXPECT_EQ(n_learn + parts.judge.size(), logs.size());
  EXPECT_EQ(parts.judge.actions(0, 0), logs.actions(n_learn, 0));
}

TEST(HoldOut, AnotherKeyHoldsOutAnotherEpisode) {
  const Dataset logs = PointMassLogs(kTruth, 6);
  std::set<double> first;
  for (uint64_t key = 1; key <= 10; ++key) first.insert(HoldOut(logs, RngKey(key)).judge.actions(0, 0));
  EXPECT_GT(first.size(), 1u);
}

}  // namespace oted::held_out_test
