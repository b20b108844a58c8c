#include "oted/stages/design/replay/kept_aside.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace oted::kept_aside_test {

constexpr double kPeriod = 0.1;  // [s]: a block of two seconds is 20 rows

/// Episodes whose rows are numbered: (row, 1).
Dataset Logs(const std::vector<int>& lengths) {
  Dataset logs;
  double row = 0;
  for (const int length : lengths) {
    for (int t = 0; t < length; ++t, ++row) {
      logs.observations.AppendRow(std::vector<double>{row});
      logs.next_observations.AppendRow(std::vector<double>{row + 1});
      logs.actions.AppendRow(std::vector<double>{0});
      logs.terminals.push_back(0);
      logs.timeouts.push_back(t + 1 == length);
    }
  }
  return logs;
}

/// The rows of a part, none of them twice.
std::set<double> Rows(const Dataset& part) {
  const auto values = part.observations.values();
  std::set<double> rows(values.begin(), values.end());
  EXPECT_EQ(static_cast<int>(rows.size()), part.size());
  return rows;
}

TEST(KeepAside, EachRowGoesToOnePartAndAFifthOrSoIsKeptAside) {
  for (const std::vector<int>& lengths : std::vector<std::vector<int>>{{40},
                                                                       {300},
                                                                       {300, 40},
                                                                       {300, 300, 300, 300, 300, 300},
                                                                       {15, 15, 15, 15, 15},
                                                                       {300, 20, 300, 20, 300, 300}}) {
    const Dataset logs = Logs(lengths);
    const HeldOutParts parts = KeepAside(logs, kPeriod, RngKey(1));
    std::set<double> all = Rows(parts.learn);
    all.merge(Rows(parts.judge));
    EXPECT_EQ(static_cast<int>(all.size()), logs.size());
    EXPECT_GE(parts.judge.size(), 0.12 * logs.size());
    EXPECT_LE(parts.judge.size(), 0.37 * logs.size());
    const auto learned = parts.learn.observations.values();
    EXPECT_EQ(std::vector<double>(parts.learned_rows.begin(), parts.learned_rows.end()),
              std::vector<double>(learned.begin(), learned.end()))
        << "rows hold their own number";
  }
}

TEST(KeepAside, OfManyLongRecordingsOneIsKeptWholeAndOfTheOthersBlocks) {
  const HeldOutParts parts = KeepAside(Logs({100, 100, 100, 100, 100}), kPeriod, RngKey(1));
  std::multiset<int> lengths;
  for (const Episode& episode : parts.judge.Episodes()) lengths.insert(episode.size());
  EXPECT_EQ(lengths, (std::multiset<int>{20, 20, 20, 20, 100}));
  EXPECT_EQ(parts.n_whole, 1);
  EXPECT_EQ(parts.recording.size(), parts.learn.Episodes().size());
  EXPECT_EQ(parts.recording.back(), 3) << "four recordings are learned from";
  // Rows hold their own number.
  const std::vector<Episode> learned = parts.learn.Episodes();
  for (size_t e = 0; e < learned.size(); ++e) {
    const int logged_as = parts.logged_as[static_cast<size_t>(parts.recording[e])];
    EXPECT_EQ(static_cast<int>(parts.learn.observations(learned[e].begin, 0)) / 100, logged_as);
  }
  EXPECT_EQ(parts.judge.Episodes().front().size(), 100) << "the whole ones stand first";
  EXPECT_EQ(KeepAside(Logs({300, 300}), kPeriod, RngKey(1)).n_whole, 0) << "of few, each is learned from";
}

TEST(KeepAside, ManyShortEpisodesAreKeptWhole) {
  const HeldOutParts parts = KeepAside(Logs({30, 30, 30, 30, 30}), kPeriod, RngKey(1));
  EXPECT_EQ(parts.judge.Episodes().size(), 1u);
  EXPECT_EQ(parts.learn.Episodes().size(), 4u);
}

TEST(KeepAside, AnEpisodeTooShortToShareJudgesWhatItTeaches) {
  const HeldOutParts parts = KeepAside(Logs({3}), kPeriod, RngKey(1));
  EXPECT_EQ(parts.judge.size(), 3);
  EXPECT_EQ(parts.learn.size(), 3);
  EXPECT_EQ(parts.learned_rows, (std::vector<int>{0, 1, 2}));
}

}  // namespace oted::kept_aside_test
