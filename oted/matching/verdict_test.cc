#include "oted/matching/verdict.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace oted::verdict_test {

constexpr double kLog2 = std::numbers::ln2;

/// Two parameters in [0, 2] with nominal 1; q has the given means and spreads in x, the logits of the range.
Designer MakeDesigner(std::vector<double> mean, std::vector<double> std) {
  Designer q(ParameterSpace({{.name = "a", .field = "env/a", .low = 0, .high = 2},
                             {.name = "b", .field = "env/b", .low = 0, .high = 2}}),
             1.0);
  for (double& s : std) s = std::log(s);
  q.Restore(std::move(mean), std::move(std));
  return q;
}

/// z of x for bounds [0, 2].
double ZOf(double x) { return 2.0 / (1.0 + std::exp(-x)); }

TEST(SummarizeParameters, OneDesignIsItsOwnSummary) {
  const Designer q = MakeDesigner({0.4, -1.0}, {0.1, 0.2});
  const auto summary = SummarizeParameters({q}, 0, {true, true});
  ASSERT_EQ(summary.size(), 2u);
  EXPECT_DOUBLE_EQ(summary[0].mode, ZOf(0.4));
  EXPECT_DOUBLE_EQ(summary[1].std, q.Std()[1]);
  // The quantiles of a monotone image are the images of the quantiles; 1.6449 is the normal's at 95 %.
  EXPECT_NEAR(summary[0].interval90_low, ZOf(0.4 - 1.644854 * 0.1), 1e-6);
  EXPECT_NEAR(summary[0].interval90_high, ZOf(0.4 + 1.644854 * 0.1), 1e-6);
}

TEST(SummarizeParameters, SpreadIsThatOfTheMixture) {
  // Two narrow designs that disagree: within each the variance is near 0, between them (m1 - m2)^2 / 4.
  const Designer one = MakeDesigner({-1, 0}, {1e-3, 1e-3}), two = MakeDesigner({1, 0}, {1e-3, 1e-3});
  const auto summary = SummarizeParameters({one, two}, 1, {true, true});
  EXPECT_NEAR(summary[0].std, 0.5 * (ZOf(1) - ZOf(-1)), 1e-4);
  EXPECT_NEAR(summary[0].interval90_low, ZOf(-1), 2e-3);
  EXPECT_NEAR(summary[0].interval90_high, ZOf(1), 2e-3);
  EXPECT_LT(summary[1].std, 1e-3) << "they agree on the second";
}

TEST(SummarizeParameters, TheModeIsThatOfTheBestDesignNotTheAverage) {
  const Designer one = MakeDesigner({-1, 0}, {0.1, 0.1}), two = MakeDesigner({1, 0}, {0.1, 0.1});
  EXPECT_DOUBLE_EQ(SummarizeParameters({one, two}, 0, {true, true})[0].mode, ZOf(-1));
  EXPECT_DOUBLE_EQ(SummarizeParameters({one, two}, 1, {true, true})[0].mode, ZOf(1));
}

TEST(SummarizeParameters, VerdictFollowsTheSpreadInUnitsOfTheUniformPriors) {
  // At x = 0 the slope dz/dx is 0.5: std(z) = 0.5 std(x), and the uniform's is 2 / sqrt(12).
  const double uniform = 2.0 / std::sqrt(12.0);
  const auto verdict = [&](double fraction) {
    const double std = 2.0 * fraction * uniform;
    return SummarizeParameters({MakeDesigner({0, 0}, {std, std})}, 0, {true, true})[0].verdict;
  };
  EXPECT_EQ(verdict(0.24), ParameterVerdict::kIdentified);
  EXPECT_EQ(verdict(0.26), ParameterVerdict::kWeak);
  EXPECT_EQ(verdict(0.59), ParameterVerdict::kWeak);
  EXPECT_EQ(verdict(0.61), ParameterVerdict::kNotIdentified);
}

TEST(SummarizeParameters, WithoutEffectAParameterIsNotIdentifiedHoweverNarrow) {
  const auto summary = SummarizeParameters({MakeDesigner({0, 0}, {0.01, 0.01})}, 0, {true, false});
  EXPECT_EQ(summary[0].verdict, ParameterVerdict::kIdentified);
  EXPECT_EQ(summary[1].verdict, ParameterVerdict::kNotIdentified);
}

TEST(JudgeDesign, NoGapWhenTheUndesignedSimulatorMatchesAndTheDesignGainsNothing) {
  EXPECT_EQ(JudgeDesign(kLog2 - 0.02, kLog2 - 0.02), DesignVerdict::kNoGap);
  EXPECT_EQ(JudgeDesign(kLog2 - 0.02, kLog2 - 0.05), DesignVerdict::kNoGap) << "the design lost a little";
  EXPECT_EQ(JudgeDesign(kLog2 - 0.09, kLog2 - 0.01), DesignVerdict::kGapClosed) << "a small gap, but closed";
}

TEST(JudgeDesign, GapClosedNearLog2OrWhenHalfOfALargeGapIsGone) {
  EXPECT_EQ(JudgeDesign(kLog2 - 0.6, kLog2 - 0.34), DesignVerdict::kGapClosed);
  EXPECT_EQ(JudgeDesign(kLog2 - 0.69, kLog2 - 0.34), DesignVerdict::kGapClosed);
}

TEST(JudgeDesign, OutsideTheFamilyWhenLogsAndDesignStayApart) {
  EXPECT_EQ(JudgeDesign(kLog2 - 0.6, kLog2 - 0.5), DesignVerdict::kOutsideFamily);
  EXPECT_EQ(JudgeDesign(kLog2 - 0.5, kLog2 - 0.6), DesignVerdict::kOutsideFamily) << "worse than no design";
}

FitEvidence Noise(std::vector<double> short_windows, std::vector<double> long_windows) {
  return {.window = 16,
          .explained = 1,
          .noise_std = short_windows,
          .scale = std::vector<double>(short_windows.size(), 1.0),
          .short_noise_std = short_windows,
          .long_noise_std = std::move(long_windows),
          .suspects = {}};
}

TEST(JudgeFit, DriftInOneChannelIsOutsideTheFamilyAndNamesIt) {
  const Designer q = MakeDesigner({0.5, 0}, {0.01, 0.01});
  EXPECT_EQ(JudgeFit(q, Noise({0.1, 1e-8}, {0.11, 1.1e-8})), DesignVerdict::kGapClosed);
  const FitEvidence drift = Noise({0.1, 1e-3}, {0.1, 8e-3});
  EXPECT_EQ(JudgeFit(q, drift), DesignVerdict::kOutsideFamily);
  EXPECT_EQ(DisagreeingChannels(drift), std::vector<int>{1});
  EXPECT_EQ(JudgeFit(q, Noise({3e-8, 3e-8}, {3e-8, 5e-6})), DesignVerdict::kGapClosed) << "rounding, not drift";
}

TEST(JudgeFit, ASmallerDriftOfAllChannelsTogetherIsOutsideTheFamilyToo) {
  const Designer q = MakeDesigner({0.5, 0}, {0.01, 0.01});
  EXPECT_EQ(DisagreeingChannels(Noise({0.1, 0.1, 0.1}, {0.13, 0.1, 0.1})), std::vector<int>{}) << "one, 1.3 times";
  EXPECT_EQ(DisagreeingChannels(Noise({0.1, 0.1, 0.1}, {0.13, 0.125, 0.1})), (std::vector<int>{0, 1}))
      << "1.175 together";
  // Clean channels that only round do not outvote those that show something.
  EXPECT_EQ(DisagreeingChannels(Noise({0.1, 3e-8, 3e-8}, {0.15, 3e-8, 3e-8})), std::vector<int>{0});
}

TEST(JudgeFit, WhereManyWindowsAreNotExplainedOnlyTheWindowsUsedCountAndMayDriftMore) {
  FitEvidence fit = Noise({0.1, 0.1}, {0.3, 0.1});
  EXPECT_EQ(DisagreeingChannels(fit), std::vector<int>{0});
  fit.explained = 0.5;
  EXPECT_EQ(DisagreeingChannels(fit), std::vector<int>{}) << "those that were given up are chaotic";
  fit.noise_std[0] = 0.17;
  EXPECT_EQ(DisagreeingChannels(fit), std::vector<int>{});
  fit.noise_std[0] = 0.18;
  EXPECT_EQ(DisagreeingChannels(fit), std::vector<int>{0});
}

TEST(JudgeFit, ASuspectIsOutsideTheFamily) {
  const Designer q = MakeDesigner({0.5, 0}, {0.01, 0.01});
  FitEvidence fit = Noise({0.1, 0.1}, {0.1, 0.1});
  EXPECT_EQ(JudgeFit(q, fit), DesignVerdict::kGapClosed);
  fit.suspects = {{"joint/*/damping", 0.6, 0.05}};
  EXPECT_EQ(JudgeFit(q, fit), DesignVerdict::kOutsideFamily);
  EXPECT_EQ(DisagreeingChannels(fit), std::vector<int>{});
}

TEST(JudgeFit, AnEstimateAtABoundIsOutsideTheFamilyUnlessItsNominalValueIsThere) {
  const FitEvidence fit = Noise({0.1}, {0.1});
  const Designer stuck = MakeDesigner({0.5, -6.0}, {0.01, 1});
  EXPECT_EQ(JudgeFit(stuck, fit), DesignVerdict::kOutsideFamily);
  EXPECT_EQ(ParametersAtBounds(stuck), std::vector<int>{1});
  EXPECT_EQ(ParametersAtBounds(MakeDesigner({6.0, -4.0}, {1, 1})), std::vector<int>{0})
      << "1.8 % of the range is inside";
  const ParameterSpace from_zero({{.name = "a", .field = "env/a", .low = 1, .high = 2}});
  const Designer at_nominal(from_zero, Eigen::VectorXd::Constant(1, -6.0), Eigen::MatrixXd::Identity(1, 1));
  EXPECT_EQ(JudgeFit(at_nominal, fit), DesignVerdict::kNoGap);
}

TEST(JudgeFit, NoGapWhereTheNominalParametersCannotBeTold) {
  const FitEvidence fit = Noise({0.1}, {0.1});
  // The 99 % region of two parameters reaches to 3.03 standard deviations.
  EXPECT_EQ(JudgeFit(MakeDesigner({2.9, 0}, {1, 1}), fit), DesignVerdict::kNoGap);
  EXPECT_EQ(JudgeFit(MakeDesigner({3.2, 0}, {1, 1}), fit), DesignVerdict::kGapClosed);
  EXPECT_EQ(JudgeFit(MakeDesigner({2.9, 2.9}, {1, 1}), fit), DesignVerdict::kGapClosed) << "each alone would pass";
  EXPECT_EQ(JudgeFit(MakeDesigner({0.02, 0}, {1e-6, 1e-6}), fit), DesignVerdict::kNoGap) << "half a hundredth";
}

TEST(JudgeFit, ATradeOffDoesNotHideAGap) {
  // Only a + b is known, and it is off: each alone is wide enough to hold its nominal value.
  Eigen::MatrixXd covariance(2, 2);
  covariance << 1, -0.9999, -0.9999, 1;
  const ParameterSpace space = MakeDesigner({0, 0}, {1, 1}).space();
  EXPECT_EQ(JudgeFit(Designer(space, Eigen::Vector2d(0.5, 0.5), covariance), Noise({0.1}, {0.1})),
            DesignVerdict::kGapClosed);
  EXPECT_EQ(JudgeFit(Designer(space, Eigen::Vector2d(0.5, -0.5), covariance), Noise({0.1}, {0.1})),
            DesignVerdict::kNoGap);
}

TEST(Verdicts, HaveTheNamesOfDesignJson) {
  EXPECT_EQ(ToString(ParameterVerdict::kIdentified), "identified");
  EXPECT_EQ(ToString(ParameterVerdict::kWeak), "weak");
  EXPECT_EQ(ToString(ParameterVerdict::kNotIdentified), "not_identified");
  EXPECT_EQ(ToString(DesignVerdict::kNoGap), "no_gap");
  EXPECT_EQ(ToString(DesignVerdict::kGapClosed), "gap_closed");
  EXPECT_EQ(ToString(DesignVerdict::kOutsideFamily), "outside_family");
}

TEST(HasMoved, OnlyAnIdentifiedParameterWellOffItsNominalValue) {
  const ParameterSpace space({{.name = "gain", .field = "env/gain", .low = 0.2, .high = 2.2}});
  const auto moved = [&](double mode, double std, ParameterVerdict verdict) {
    return HasMoved(space, {{.mode = mode, .std = std, .verdict = verdict}});
  };
  EXPECT_TRUE(moved(1.3, 0.01, ParameterVerdict::kIdentified));
  EXPECT_FALSE(moved(1.3, 0.2, ParameterVerdict::kIdentified)) << "within three spreads";
  EXPECT_FALSE(moved(1.05, 0.001, ParameterVerdict::kIdentified)) << "less than a twentieth of the range";
  EXPECT_FALSE(moved(1.3, 0.01, ParameterVerdict::kWeak));
}

}  // namespace oted::verdict_test
