#include "oted/data/describe.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/data/testing.h"

namespace oted::describe_test {

TEST(Describe, CountsLengthsReturnsAndRangesAreThoseOfTheRows) {
  const Dataset d = MakeTestDataset(25, 10);  // episodes of 10, 10 and 5 rows; the second ends in a terminal
  const DatasetSummary s = Describe(d, {.observation_names = {"a", "b", "c"}});
  EXPECT_EQ(s.n_transitions, 25);
  EXPECT_EQ(s.n_episodes, 3);
  EXPECT_EQ(s.shortest, 5);
  EXPECT_EQ(s.longest, 10);
  EXPECT_EQ(s.median_length, 10);
  EXPECT_EQ(s.n_terminals, 1);
  EXPECT_EQ(s.n_timeouts, 1);
  EXPECT_EQ(s.returns, (std::vector<double>{45 / 4.0, 145 / 4.0, 110 / 4.0}));
  EXPECT_EQ(s.nq, 2);
  EXPECT_EQ(s.nv, 1);
  ASSERT_EQ(s.observations.size(), 3u);
  EXPECT_EQ(s.observations[1].name, "b");
  EXPECT_EQ(s.observations[1].low, 1);
  EXPECT_NEAR(s.observations[1].high, 3.4, 1e-12);
  EXPECT_NEAR(s.observations[1].mean, 2.2, 1e-12);
  EXPECT_NEAR(s.observations[1].std, 0.1 * std::sqrt((25.0 * 25 - 1) / 12), 1e-12);
  EXPECT_EQ(s.actions[0].name, "actions[0]");
}

TEST(Describe, EpisodesAreChosenByNumberOrRange) {
  const Dataset d = MakeTestDataset(50, 10);
  const auto begins = [&](const std::string& which) {
    std::vector<int> rows;
    for (const Episode& e : ChooseEpisodes(d, which)) rows.push_back(e.begin);
    return rows;
  };
  EXPECT_EQ(begins("all").size(), 5u);
  EXPECT_EQ(begins("2"), (std::vector<int>{0, 10}));
  EXPECT_EQ(begins("2-4"), (std::vector<int>{10, 20, 30}));
  for (const char* text : {"0", "4-2", "-3", "a", "1-b", "1.5", ""}) {
    EXPECT_NE(MessageOf<UsageError>([&] { ChooseEpisodes(d, text); }).find("or all"), std::string::npos) << text;
  }
  EXPECT_NE(MessageOf<DataError>([&] { ChooseEpisodes(d, "3-6"); }).find("holds 5"), std::string::npos);
}

}  // namespace oted::describe_test
