#include "oted/data/describe.h"

#include <gtest/gtest.h>

#include <cmath>

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

}  // namespace oted::describe_test
