#include "oted/base/statistics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace oted::statistics_test {

TEST(Statistics, AreThoseOfASampleWorkedByHand) {
  const std::vector<double> values = {2, 4, 4, 4, 5, 5, 7, 9};  // squared deviations from 5 add up to 32
  EXPECT_DOUBLE_EQ(Mean(values), 5);
  EXPECT_DOUBLE_EQ(StandardDeviation(values), std::sqrt(32.0 / 7));
  EXPECT_EQ(Median({9, 2, 5}), 5);
  EXPECT_EQ(Median({9, 2, 5, 4}), 5);  // of the two in the middle the upper one
}

TEST(Statistics, OfTooFewValuesAreZero) {
  EXPECT_EQ(Mean({}), 0);
  EXPECT_EQ(StandardDeviation({}), 0);
  EXPECT_EQ(Median({}), 0);
  const std::vector<double> one = {3};
  EXPECT_EQ(Mean(one), 3);
  EXPECT_EQ(StandardDeviation(one), 0);
}

}  // namespace oted::statistics_test
