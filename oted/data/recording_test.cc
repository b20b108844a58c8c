#include "oted/data/recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::recording_test {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

/// One episode at 1 kHz: s = (t, 3 t), the action a step function of the controller's clock, which ticks every
/// `hold` rows, first at row `phase`; reward 1 per row.
Recording MakeRecording(int rows, int hold, int phase) {
  Recording r;
  r.file = "log.csv";
  for (int i = 0; i < rows; ++i) {
    const double t = 0.001 * i;
    r.times.push_back(t);
    r.observations.AppendRow(std::vector<double>{t, 3 * t});
    r.actions.AppendRow(std::vector<double>{std::floor(static_cast<double>(i - phase) / hold)});
    r.rewards.push_back(1);
  }
  r.runs = {{0, rows, false}};
  r.period_s = 0.001;
  return r;
}

TEST(Recording, ResamplingToTheControllersClockGivesItsActions) {
  for (const int phase : {0, 3, 7}) {
    const Recording r = Resample(MakeRecording(101, 8, phase), 0.008);
    const Dataset d = ToDataset(r);
    ASSERT_EQ(d.size(), (100 - phase) / 8) << phase;
    for (int k = 0; k < d.size(); ++k) {
      EXPECT_EQ(d.actions(k, 0), k) << phase;
      EXPECT_NEAR(d.observations(k, 0), 0.001 * phase + 0.008 * k, 1e-12);
      EXPECT_NEAR(d.next_observations(k, 1), 3 * (0.001 * phase + 0.008 * (k + 1)), 1e-12);
      EXPECT_EQ(d.rewards[static_cast<size_t>(k)], 8);
    }
    EXPECT_EQ(d.period_s, 0.008);
    EXPECT_THAT(d.remarks, ElementsAre(HasSubstr("resampled from one row per 0.001 s")));
  }
}

TEST(Recording, ObservationsBetweenRowsAreInterpolated) {
  // 0.0025 s is no multiple of the rows': the linear signal is still met exactly.
  const Dataset d = ToDataset(Resample(MakeRecording(101, 1000, 0), 0.0025));
  ASSERT_EQ(d.size(), 40);
  for (int k = 0; k < d.size(); ++k) EXPECT_NEAR(d.observations(k, 1), 3 * 0.0025 * k, 1e-12);
}

TEST(Recording, ActionsThatChangeWithinAPeriodAreReported) {
  const Recording r = Resample(MakeRecording(101, 5, 0), 0.010);
  EXPECT_THAT(r.warnings, Contains(AllOf(HasSubstr("within 10 of 10 control periods"), HasSubstr("at most by 1"))));
}

TEST(Recording, ATerminalStateSurvivesWhereTheGridMeetsIt) {
  Recording meets = MakeRecording(81, 8, 0), misses = MakeRecording(85, 8, 0);
  meets.runs[0].terminated = misses.runs[0].terminated = true;
  EXPECT_EQ(ToDataset(Resample(meets, 0.008)).terminals.back(), 1);
  const Dataset lost = ToDataset(Resample(misses, 0.008));
  EXPECT_EQ(lost.terminals.back(), 0);
  EXPECT_EQ(lost.timeouts.back(), 1);
  EXPECT_THAT(lost.warnings, Contains(HasSubstr("1 terminal states")));
}

TEST(Recording, ALogAtTheControlPeriodStaysAsItIsAndASlowerOneIsRefused) {
  const Recording r = MakeRecording(50, 1, 0);
  EXPECT_EQ(Resample(r, 0.001).observations, r.observations);
  EXPECT_EQ(Resample(r, 0.001005).observations, r.observations);
  EXPECT_THAT(MessageOf<DataError>([&] { Resample(r, 0.0005); }),
              AllOf(HasSubstr("'log.csv'"), HasSubstr("one row per 0.001 s"), HasSubstr("seconds")));
  // Episodes shorter than one period are left out; when none remains there is no dataset.
  EXPECT_THAT(MessageOf<DataError>([&] { ToDataset(Resample(r, 1.0)); }), HasSubstr("holds no transition"));
}

}  // namespace oted::recording_test
