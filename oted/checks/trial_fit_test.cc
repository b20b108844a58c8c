#include "oted/checks/trial_fit.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/matching/testing.h"

namespace oted {
namespace {

std::optional<TrialFit> Fit(const PointMassOptions& options, const Dataset& logs) {
  NullSink log;
  return FitBriefly(PointMassFactory(options), logs, RngKey(1), {.log = &log}, "fit");
}

TEST(FitBriefly, FindsTheValuesAndTellsWhatActsAlikeFromWhatDoesNot) {
  const std::optional<TrialFit> fit = Fit({}, PointMassLogs({1.4, 0.5, 0.5}, 20));
  ASSERT_TRUE(fit.has_value());
  EXPECT_NEAR(fit->z[0], 1.4, 0.01);
  EXPECT_NEAR(fit->z[1], 0.5, 0.01);
  EXPECT_LT(std::abs(fit->cosines(0, 1)), 0.95);
  EXPECT_EQ(fit->cosines(0, 2), 0) << "idle has no effect";
  EXPECT_EQ(fit->cosines(2, 2), 1);
}

TEST(FitBriefly, OfASimulatorThatTakesNoStateThereIsNone) {
  EXPECT_FALSE(Fit({.can_set_state = false}, PointMassLogs({1, 1, 0.5}, 5)).has_value());
}

}  // namespace
}  // namespace oted
