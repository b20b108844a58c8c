#include "oted/data/copied_rows.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/rng.h"

namespace oted::copied_rows_test {

using testing::HasSubstr;

/// One recording of 200 rows: a motion that is the same each time, read with normal noise drawn from `seed`.
Dataset Recording(uint64_t seed, double noise, double constant = 0) {
  Rng rng(seed);
  Dataset d;
  const auto read = [&](int t) {
    return std::vector<double>{std::sin(0.05 * t) + noise * rng.Normal(),
                               0.05 * std::cos(0.05 * t) + noise * rng.Normal()};
  };
  std::vector<double> now = read(0);
  for (int t = 0; t < 200; ++t) {
    std::vector<double> next = read(t + 1);
    d.observations.AppendRow(now);
    d.actions.AppendRow(std::vector<double>{std::cos(0.07 * t)});
    d.next_observations.AppendRow(next);
    d.constants.AppendRow(std::vector<double>{constant});
    d.terminals.push_back(0);
    d.timeouts.push_back(t == 199);
    now = next;
  }
  d.constant_names = {"payload"};
  return d;
}

Dataset Joined(const std::vector<Dataset>& parts) {
  Dataset all;
  for (const Dataset& part : parts) all.Append(part);
  return all;
}

TEST(FindCopiedStretches, ASecondRecordingOfTheSameMotionIsNoCopy) {
  for (const double noise : {1e-4, 0.01, 0.1}) {
    EXPECT_TRUE(FindCopiedStretches(Joined({Recording(1, noise), Recording(2, noise)})).empty()) << noise;
  }
}

TEST(FindCopiedStretches, AnExportWithFewerDigitsIsACopy) {
  for (const double digit : {0.0, 1e-7, 1e-4}) {
    Dataset again = Recording(1, 0.02);
    for (Array2<double>* m : {&again.observations, &again.next_observations}) {
      for (double& value : m->values()) value = digit > 0 ? digit * std::nearbyint(value / digit) : value;
    }
    const auto found = FindCopiedStretches(Joined({Recording(1, 0.02), Recording(2, 0.02), again}));
    EXPECT_EQ(found, (std::vector<CopiedStretch>{{400, 600, 0}})) << digit;
  }
}

TEST(FindCopiedStretches, ARobotAtRestWroteNothingTwice) {
  Dataset still = Recording(1, 0);
  for (Array2<double>* m : {&still.observations, &still.next_observations, &still.actions}) {
    std::ranges::fill(m->values(), 0.5);
  }
  EXPECT_TRUE(FindCopiedStretches(Joined({still, still})).empty());
}

TEST(FindCopiedStretches, EqualReadingsOfAnotherRobotAreNoCopy) {
  EXPECT_TRUE(FindCopiedStretches(Joined({Recording(1, 0.02, 0.1), Recording(1, 0.02, 0.2)})).empty());
}

TEST(WithoutCopies, PiecesThatOverlapAreLeftWithEachRowOnce) {
  const Dataset whole = Recording(3, 0.05);
  // Rows 0-79, 60-139, 120-199: twenty rows of the second and of the third are there already.
  const Dataset pieces = whole.Select({{0, 80}, {60, 140}, {120, 200}});
  const Dataset once = WithoutCopies(pieces);
  EXPECT_EQ(once.observations, whole.observations);
  EXPECT_EQ(once.actions, whole.actions);
  EXPECT_EQ(once.Episodes().size(), 3u);
  ASSERT_EQ(once.warnings.size(), 1u);
  EXPECT_THAT(once.warnings[0], HasSubstr("40 of 240 rows"));
  EXPECT_EQ(WithoutCopies(whole).observations, whole.observations);
}

}  // namespace oted::copied_rows_test
