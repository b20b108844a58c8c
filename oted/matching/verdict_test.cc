#include "oted/matching/verdict.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace oted::verdict_test {

constexpr double kLog2 = std::numbers::ln2;

/// Two values in [0, 2], nominal 1; q has the given means and spreads in x, the logits of the range.
Designer MakeDesigner(std::vector<double> mean, std::vector<double> std) {
  Designer q(ParameterSpace({{.name = "a", .field = "env/a", .low = 0, .high = 2, .scale = ParameterScale::kAbsolute},
                             {.name = "b", .field = "env/b", .low = 0, .high = 2, .scale = ParameterScale::kAbsolute}}),
             1.0);
  for (double& s : std) s = std::log(s);
  q.Restore(std::move(mean), std::move(std));
  return q;
}

/// z of x for bounds [0, 2].
double ZOf(double x) { return 2.0 / (1.0 + std::exp(-x)); }

TEST(SummarizeParameters, OneDesignIsItsOwnSummary) {
  const Designer q = MakeDesigner({0.4, -1.0}, {0.1, 0.2});
  const auto summary = SummarizeParameters({q}, 0, {true, true}, true);
  ASSERT_EQ(summary.size(), 2u);
  EXPECT_DOUBLE_EQ(summary[0].mode, ZOf(0.4));
  EXPECT_DOUBLE_EQ(summary[1].std, q.Std()[1]);
  // The quantiles of a monotone image are the images of the quantiles; 1.6449 is the normal's at 95 %.
  EXPECT_NEAR(summary[0].interval90_low, ZOf(0.4 - 1.644854 * 0.1), 1e-6);
  EXPECT_NEAR(summary[0].interval90_high, ZOf(0.4 + 1.644854 * 0.1), 1e-6);
}

TEST(SummarizeParameters, AnIntervalThatEndsByABoundHoldsIt) {
  const auto summary = SummarizeParameters({MakeDesigner({-7, 7}, {0.5, 0.5})}, 0, {true, true}, true);
  EXPECT_EQ(summary[0].interval90_low, 0) << "no logit is that of nothing";
  EXPECT_LT(summary[0].interval90_high, 0.01);
  EXPECT_EQ(summary[1].interval90_high, 2);
  EXPECT_GT(summary[1].interval90_low, 1.99);
}

TEST(SummarizeParameters, WhatAnotherDesignAsGoodDisputesIsNotIdentified) {
  const Designer q = MakeDesigner({0.5, 0}, {0.05, 1});
  const ParameterSummary alone = SummarizeParameters({q}, 0, {true, true}, true)[0];
  EXPECT_EQ(alone.verdict, ParameterVerdict::kIdentified);
  const SearchInterval own{alone.interval90_low, alone.interval90_high},
      other{alone.interval90_low - 0.02, alone.interval90_low - 0.01};
  const auto with = [&](const SearchInterval& interval) {
    return SummarizeParameters({q}, 0, {true, true}, true, {}, {{interval, {0, 1}}})[0];
  };
  EXPECT_EQ(with(own).verdict, ParameterVerdict::kIdentified);
  EXPECT_EQ(with({2, 1}).verdict, ParameterVerdict::kIdentified) << "which says nothing of it";
  EXPECT_EQ(with(other).verdict, ParameterVerdict::kWeak);
  EXPECT_EQ(with(other).interval90_low, other.low);
  EXPECT_EQ(with(other).interval90_high, own.high);
}

TEST(SummarizeParameters, SpreadIsThatOfTheMixture) {
  // Two narrow designs that disagree: within each the variance is near 0, between them (m1 - m2)^2 / 4.
  const Designer one = MakeDesigner({-1, 0}, {1e-3, 1e-3}), two = MakeDesigner({1, 0}, {1e-3, 1e-3});
  const auto summary = SummarizeParameters({one, two}, 1, {true, true}, true);
  EXPECT_NEAR(summary[0].std, 0.5 * (ZOf(1) - ZOf(-1)), 1e-4);
  EXPECT_NEAR(summary[0].interval90_low, ZOf(-1), 2e-3);
  EXPECT_NEAR(summary[0].interval90_high, ZOf(1), 2e-3);
  EXPECT_LT(summary[1].std, 1e-3) << "they agree on the second";
}

TEST(SummarizeParameters, TheModeIsThatOfTheBestDesignNotTheAverage) {
  const Designer one = MakeDesigner({-1, 0}, {0.1, 0.1}), two = MakeDesigner({1, 0}, {0.1, 0.1});
  EXPECT_DOUBLE_EQ(SummarizeParameters({one, two}, 0, {true, true}, true)[0].mode, ZOf(-1));
  EXPECT_DOUBLE_EQ(SummarizeParameters({one, two}, 1, {true, true}, true)[0].mode, ZOf(1));
}

/// Of the first parameter, from a q of standard deviation `std` about `mean` in x.
ParameterVerdict LabelOf(double mean, double std, bool reaches_floor = true) {
  return SummarizeParameters({MakeDesigner({mean, 0}, {std, 1})}, 0, {true, true}, reaches_floor)[0].verdict;
}

TEST(SummarizeParameters, VerdictFollowsTheWidthOfTheIntervalInUnitsOfThePriors) {
  // The central 90 % interval of u at mean 0 is 2 / (1 + exp(-1.645 std)) - 1 wide; the prior's is 0.9.
  const auto label_of = [](double fraction) {
    const double std = -std::log(2 / (1 + 0.9 * fraction) - 1) / 1.644854;
    Designer q(ParameterSpace({{.name = "a", .field = "env/a", .low = -1, .scale = ParameterScale::kAbsolute}}), 1.0);
    q.Restore({0}, {std::log(std)});
    return SummarizeParameters({q}, 0, {true}, true)[0].verdict;
  };
  EXPECT_EQ(label_of(0.24), ParameterVerdict::kIdentified);
  EXPECT_EQ(label_of(0.26), ParameterVerdict::kWeak);
  EXPECT_EQ(label_of(0.59), ParameterVerdict::kWeak);
  EXPECT_EQ(label_of(0.61), ParameterVerdict::kNotIdentified);
}

TEST(SummarizeParameters, IntervalsHoldThoseOfOtherDesigns) {
  const Designer q = MakeDesigner({0, 0}, {0.01, 0.01});
  const auto alone = SummarizeParameters({q}, 0, {true, true}, false);
  const auto with = SummarizeParameters({q}, 0, {true, true}, false, {},
                                        {{{0.4, 0.5}, {alone[1].interval90_low, alone[1].interval90_high}}});
  EXPECT_EQ(with[0].interval90_low, 0.4);
  EXPECT_EQ(with[0].interval90_high, alone[0].interval90_high);
  EXPECT_EQ(with[1].interval90_low, alone[1].interval90_low);
  EXPECT_EQ(with[0].mode, alone[0].mode);
  // So wide a one says nothing.
  EXPECT_EQ(SummarizeParameters({q}, 0, {true, true}, false, {}, {{{0.2, 2.0}, {1.0, 1.0}}})[0].verdict,
            ParameterVerdict::kNotIdentified);
}

TEST(SummarizeParameters, AnEndThatPredictionsDoNotTellIsOpen) {
  const Designer q = MakeDesigner({0, 0}, {0.01, 0.01});
  const std::vector<bool> effect = {true, true};
  const auto whole = SummarizeParameters({q}, 0, effect, true);
  EXPECT_EQ(whole[0].verdict, ParameterVerdict::kIdentified);
  const auto above = SummarizeParameters({q}, 0, effect, true, {{.parameter = 0, .above = true}});
  EXPECT_EQ(above[0].interval90_low, whole[0].interval90_low);
  EXPECT_EQ(above[0].interval90_high, q.space()[0].high);
  EXPECT_EQ(above[0].verdict, ParameterVerdict::kWeak) << "and not at its bound";
  EXPECT_EQ(above[1].verdict, ParameterVerdict::kIdentified);
  const auto both = SummarizeParameters({q}, 0, effect, true, {{.parameter = 0, .above = true}, {.parameter = 0}});
  EXPECT_EQ(both[0].verdict, ParameterVerdict::kNotIdentified);
}

TEST(SummarizeParameters, WidthsAreThoseOfTheSearchsScale) {
  // In z the interval is narrow near the lower bound of a parameter that is searched by its logarithm.
  const ParameterSpace space({{.name = "a", .field = "env/a", .low = 0.01, .high = 100, .logarithmic = true}});
  const Designer q(space, Eigen::VectorXd::Constant(1, -1.0), Eigen::MatrixXd::Constant(1, 1, 0.64));
  const ParameterSummary summary = SummarizeParameters({q}, 0, {true}, true)[0];
  EXPECT_LT(summary.interval90_high - summary.interval90_low, 0.1 * 100);
  EXPECT_EQ(summary.verdict, ParameterVerdict::kWeak);
}

TEST(SummarizeParameters, AValueKnownToHalfOfItselfIsNotIdentified) {
  const auto verdict = [](const char* field, double nominal, double mean, double std) {
    ParameterSpec spec;
    spec.name = "a";
    spec.field = field;
    spec.low = 0;
    spec.nominal = nominal;
    if (nominal != 1) spec.scale = ParameterScale::kAbsolute;
    Designer q(ParameterSpace({spec}), 1.0);
    q.Restore({mean}, {std::log(std)});
    return SummarizeParameters({q}, 0, {true}, true)[0].verdict;
  };
  EXPECT_EQ(verdict("joint/*/damping", 0, -6, 1), ParameterVerdict::kWeak) << "0.001 to 0.025 of [0, 2]";
  EXPECT_EQ(verdict("joint/*/damping", 0, -1, 0.1), ParameterVerdict::kIdentified) << "0.48 to 0.60";
  EXPECT_EQ(verdict("joint/*/damping", 0, -12, 1), ParameterVerdict::kIdentified) << "nothing, as good as";
  EXPECT_EQ(verdict("joint/*/damping", 1, -6, 1), ParameterVerdict::kIdentified) << "next to none of the model's";
  EXPECT_EQ(verdict("joint/*/damping", 1, -1, 0.3), ParameterVerdict::kWeak) << "0.37 to 0.75 of the model's";
  EXPECT_EQ(verdict("joint/*/damping", 1, -1, 0.1), ParameterVerdict::kIdentified);
  EXPECT_EQ(verdict("joint/*/frictionloss", 0.003, -6, 1), ParameterVerdict::kWeak) << "of [0, 2], all of the model's";
  EXPECT_EQ(verdict("action/delay", 0, -6, 1), ParameterVerdict::kIdentified) << "a control step has a size";
}

TEST(SummarizeParameters, AtABoundNothingIsIdentified) {
  const ParameterSpace space({{.name = "a", .field = "joint/*/damping", .low = 0.5, .high = 2},
                              {.name = "b", .field = "joint/*/frictionloss", .low = 0, .high = 2}});
  const auto labels = [&](double x) {
    const Designer q(space, Eigen::VectorXd::Constant(2, x), 0.01 * Eigen::MatrixXd::Identity(2, 2));
    const auto summaries = SummarizeParameters({q}, 0, {true, true}, true);
    return std::vector<ParameterVerdict>{summaries[0].verdict, summaries[1].verdict};
  };
  using enum ParameterVerdict;
  EXPECT_EQ(labels(-6), (std::vector{kAtBound, kIdentified})) << "no friction is a value, not the end of a range";
  EXPECT_EQ(labels(6), (std::vector{kAtBound, kAtBound}));
  EXPECT_EQ(labels(0), (std::vector{kIdentified, kIdentified}));
}

TEST(SummarizeParameters, WhereTheFamilyIsRejectedNothingIsMoreThanWeak) {
  EXPECT_EQ(LabelOf(0, 0.01, true), ParameterVerdict::kIdentified);
  EXPECT_EQ(LabelOf(0, 0.01, false), ParameterVerdict::kWeak);
  EXPECT_EQ(LabelOf(0, 1.6, false), ParameterVerdict::kNotIdentified);
}

TEST(SummarizeParameters, WithoutEffectAParameterIsNotIdentifiedHoweverNarrow) {
  const auto summary = SummarizeParameters({MakeDesigner({0, 0}, {0.01, 0.01})}, 0, {true, false}, true);
  EXPECT_EQ(summary[0].verdict, ParameterVerdict::kIdentified);
  EXPECT_EQ(summary[1].verdict, ParameterVerdict::kNotIdentified);
}

TEST(JudgeDesign, NoGapWhenTheUndesignedSimulatorMatchesAndTheDesignGainsNothing) {
  EXPECT_EQ(JudgeDesign(kLog2 - 0.02, kLog2 - 0.02, 1000), DesignVerdict::kNoGap);
  EXPECT_EQ(JudgeDesign(kLog2 - 0.02, kLog2 - 0.05, 1000), DesignVerdict::kNoGap) << "the design lost a little";
  EXPECT_EQ(JudgeDesign(kLog2 - 0.09, kLog2 - 0.01, 1000), DesignVerdict::kGapClosed) << "a small gap, but closed";
}

TEST(JudgeDesign, GapClosedNearLog2AndNarrowedWhereATenthOfTheGapIsGone) {
  EXPECT_EQ(JudgeDesign(kLog2 - 0.6, kLog2 - 0.09, 1000), DesignVerdict::kGapClosed);
  EXPECT_EQ(JudgeDesign(kLog2 - 0.6, kLog2 - 0.34, 1000), DesignVerdict::kGapNarrowed);
  EXPECT_EQ(JudgeDesign(kLog2 - 0.6, kLog2 - 0.53, 1000), DesignVerdict::kGapNarrowed);
}

TEST(JudgeDesign, OutsideTheFamilyWhereTheDesignIsNoNearerThanTheNominalSimulator) {
  EXPECT_EQ(JudgeDesign(kLog2 - 0.6, kLog2 - 0.56, 1000), DesignVerdict::kOutsideFamily);
  EXPECT_EQ(JudgeDesign(kLog2 - 0.5, kLog2 - 0.6, 1000), DesignVerdict::kOutsideFamily) << "worse than no design";
}

TEST(JudgeDesign, AHandfulOfTransitionsSupportsNoWord) {
  EXPECT_EQ(JudgeDesign(kLog2, kLog2, kFewestJudged - 1), DesignVerdict::kUndecided);
  EXPECT_EQ(JudgeDesign(kLog2, kLog2, kFewestJudged), DesignVerdict::kNoGap);
}

/// One horizon with two channels.
HeldOutPrediction Predicted(Estimated excess, Estimated gain, Estimated of_first = {}) {
  HeldOutPrediction::Horizon horizon;
  horizon.seconds = 0.5;
  horizon.channels = {
      {.nominal = 2, .designed = 1, .floor = 1, .spread = 5, .judged = true, .excess = of_first, .gain = {}},
      {.nominal = 2, .designed = 1, .floor = 1, .spread = 5, .judged = true, .excess = {}, .gain = {}}};
  horizon.excess = excess;
  horizon.gain = gain;
  HeldOutPrediction prediction;
  prediction.horizons = {horizon};
  return prediction;
}

/// By q alone.
DesignVerdict Judged(const Designer& q, const HeldOutPrediction& prediction) {
  return JudgePrediction(q, prediction, {.at_bounds = ParametersAtBounds(q)});
}

const Estimated kNothing = {0, 0.01}, kMuch = {1, 0.1};

TEST(ReachesFloor, AnExcessCountsWhereItIsNoticeableAndBeyondChance) {
  EXPECT_TRUE(ReachesFloor(Predicted(kNothing, kMuch)));
  EXPECT_TRUE(ReachesFloor(Predicted({0.09, 0.001}, kMuch))) << "sure, but nobody would notice";
  EXPECT_TRUE(ReachesFloor(Predicted({0.3, 0.2}, kMuch))) << "visible, but chance reaches it";
  EXPECT_FALSE(ReachesFloor(Predicted({0.2, 0.05}, kMuch)));
  EXPECT_TRUE(ReachesFloor(Predicted({-3, 0.01}, kMuch))) << "nearer than the floor";
}

TEST(ReachesFloor, WindowsThatWouldNotShowAnExcessDoNotBearItOut) {
  const HeldOutPrediction few = Predicted({0.1, 0.6}, kMuch);  // up to 1.9 times the floor's error
  EXPECT_NEAR(MostTimesFloor(few.horizons[0]), std::exp(0.65), 1e-12);
  EXPECT_FALSE(IsFloorTold(few));
  EXPECT_FALSE(ReachesFloor(few));
  EXPECT_TRUE(ChannelsOff(few).empty());
  const Designer moved = MakeDesigner({0.5, 0}, {0.01, 0.01});
  EXPECT_EQ(Judged(moved, few), DesignVerdict::kGapNarrowed);
  EXPECT_EQ(Judged(moved, Predicted({0.1, 0.6}, {0.1, 0.3})), DesignVerdict::kUndecided);
}

TEST(ReachesFloor, EveryHorizonThatIsToldHasToShowIt) {
  HeldOutPrediction two = Predicted(kNothing, kMuch);
  two.horizons[0].seconds = 0.1;
  two.horizons.push_back(Predicted({0.1, 0.6}, kMuch).horizons[0]);
  two.horizons[1].seconds = 1;
  EXPECT_TRUE(ReachesFloor(two)) << "few windows are as long as a second";
  two.horizons[1].seconds = 0.5;
  EXPECT_FALSE(ReachesFloor(two));
}

TEST(ReachesFloor, OneChannelOrOneHorizonIsEnough) {
  EXPECT_FALSE(ReachesFloor(Predicted(kNothing, kMuch, kMuch)));
  EXPECT_EQ(ChannelsOff(Predicted(kNothing, kMuch, kMuch)), std::vector<int>{0});
  EXPECT_TRUE(ReachesFloor(Predicted(kNothing, kMuch, {1, 0.3}))) << "of many channels chance moves one";
  HeldOutPrediction two = Predicted(kNothing, kMuch);
  two.horizons.push_back(Predicted(kMuch, kMuch).horizons[0]);
  EXPECT_FALSE(ReachesFloor(two));
  EXPECT_EQ(ChannelsOff(two).size(), 1u) << "all are off a little: one is named";
  EXPECT_TRUE(ChannelsOff(Predicted(kNothing, kMuch)).empty());
}

TEST(JudgePrediction, ANominalSimulatorThatIsFarOffIsNoneWithoutAGapHoweverWideTheIntervals) {
  const Designer wide = MakeDesigner({0.5, 0.5}, {2, 2});
  const Estimated unsure = {11, 20};  // of two windows
  EXPECT_EQ(Judged(wide, Predicted(kNothing, unsure)), DesignVerdict::kGapClosed);
  EXPECT_EQ(Judged(wide, Predicted(kNothing, {0.3, 0.1})), DesignVerdict::kNoGap) << "within its reach";
}

TEST(PredictsBetter, AGainCountsWhereItIsSureAndNoHorizonLoses) {
  EXPECT_TRUE(PredictsBetter(Predicted(kNothing, kMuch)));
  EXPECT_FALSE(PredictsBetter(Predicted(kNothing, {0.1, 0.1})));
  HeldOutPrediction two = Predicted(kNothing, kMuch);
  two.horizons.push_back(Predicted(kNothing, {-1, 0.1}).horizons[0]);
  EXPECT_FALSE(PredictsBetter(two));
  HeldOutPrediction elsewhere = Predicted(kNothing, kMuch);
  elsewhere.horizons[0].n_of_recordings = 5;
  elsewhere.horizons[0].gain_of_recordings = {-1, 2};
  EXPECT_TRUE(PredictsBetter(elsewhere)) << "chance reaches it";
  elsewhere.horizons[0].gain_of_recordings = {-1, 0.1};
  EXPECT_FALSE(PredictsBetter(elsewhere)) << "parts of what it learned from do not outvote other recordings";
  elsewhere.horizons[0].gain_of_recordings = {3, 0.1};
  elsewhere.horizons[0].gain = {1.8, 1.2};
  EXPECT_TRUE(PredictsBetter(elsewhere)) << "nor do a few of their windows";
  elsewhere.horizons[0].gain = {-0.2, 1.2};
  EXPECT_FALSE(PredictsBetter(elsewhere)) << "all windows together are none better";
}

TEST(PredictsBetter, OneSeamOfALogHidesNoGainThatEveryOtherWindowShows) {
  HeldOutPrediction seam = Predicted(kNothing, {1.4, 0.9});
  EXPECT_FALSE(PredictsBetter(seam));
  seam.horizons[0].typical_gain = {6, 0.5};
  EXPECT_TRUE(PredictsBetter(seam));
  seam.horizons[0].gain = {-0.2, 0.9};
  EXPECT_FALSE(PredictsBetter(seam)) << "where the few windows are worse, they may be what matters";
}

TEST(PredictsBetter, LogsThatItLearnedFromCountWhereNoOthersCanJudge) {
  HeldOutPrediction learned = Predicted(kNothing, kMuch);
  learned.horizons[0].learned = true;
  EXPECT_TRUE(PredictsBetter(learned));
  learned.horizons.push_back(Predicted(kNothing, {-0.5, 0.4}).horizons[0]);
  EXPECT_FALSE(PredictsBetter(learned)) << "the logs kept aside are predicted worse, if not surely";
}

TEST(ReachesFloor, AFewWindowsThatAreFarOffLeaveItOpen) {
  const Designer moved = MakeDesigner({0.5, 0}, {0.01, 0.01});
  HeldOutPrediction some = Predicted({0.2, 0.1}, kMuch);  // of a typical window
  ASSERT_EQ(Judged(moved, some), DesignVerdict::kGapClosed);
  some.horizons[0].channels[0].designed = 2;
  some.horizons[0].channels[1].designed = 1.5;
  EXPECT_NEAR(MostTimesFloor(some.horizons[0]), std::sqrt(3), 1e-4) << "in sum";
  EXPECT_EQ(Judged(moved, some), DesignVerdict::kGapNarrowed);
  some.horizons[0].channels[1].judged = false;
  EXPECT_NEAR(MostTimesFloor(some.horizons[0]), 2, 1e-4);
  some.horizons[0].seconds = 1;
  EXPECT_EQ(Judged(moved, some), DesignVerdict::kGapClosed) << "longer replays may be chaotic";
  HeldOutPrediction exact = Predicted({0.05, 0.01}, kMuch);
  for (HeldOutPrediction::Channel& channel : exact.horizons[0].channels) {
    channel.designed = 1e-6;
    channel.floor = 1e-9;
  }
  EXPECT_EQ(Judged(moved, exact), DesignVerdict::kGapClosed) << "what nobody sees counts for nothing";
}

TEST(ReachesFloor, AFewBriefWindowsThatItLearnedFromDoNotBearItOut) {
  const Designer moved = MakeDesigner({0.5, 0}, {0.01, 0.01});
  const auto learned = [](HeldOutPrediction prediction, double seconds, int n_windows) {
    HeldOutPrediction::Horizon& horizon = prediction.horizons[0];
    horizon.learned = true;
    horizon.seconds = seconds;
    horizon.n_windows = n_windows;
    return prediction;
  };
  const HeldOutPrediction better = Predicted(kNothing, kMuch), as_good = Predicted(kNothing, kNothing);
  EXPECT_EQ(Judged(moved, learned(better, 0.1, 20)), DesignVerdict::kGapNarrowed) << "two seconds";
  EXPECT_EQ(Judged(moved, learned(as_good, 0.1, 20)), DesignVerdict::kUndecided);
  EXPECT_EQ(Judged(moved, learned(better, 0.5, 2)), DesignVerdict::kGapNarrowed);
  EXPECT_EQ(Judged(moved, learned(better, 0.5, 10)), DesignVerdict::kGapClosed);
  EXPECT_EQ(Judged(moved, learned(better, 0, 9)), DesignVerdict::kGapNarrowed) << "time has no unit";
  HeldOutPrediction exact = learned(better, 0.1, 6);
  for (HeldOutPrediction::Channel& channel : exact.horizons[0].channels) channel.designed = channel.floor = 1e-9;
  EXPECT_EQ(Judged(moved, exact), DesignVerdict::kGapClosed) << "no few numbers follow exact readings by chance";
}

TEST(JudgePrediction, TheFloorAndTheGainDecide) {
  const Designer moved = MakeDesigner({0.5, 0}, {0.01, 0.01});
  EXPECT_EQ(Judged(moved, Predicted(kNothing, kMuch)), DesignVerdict::kGapClosed);
  EXPECT_EQ(Judged(moved, Predicted(kNothing, kNothing)), DesignVerdict::kNoGap) << "the nominal one as well";
  EXPECT_EQ(Judged(moved, Predicted(kNothing, {0.9, 0.7})), DesignVerdict::kGapClosed)
      << "a gain that is not sure is no proof that there is no gap";
  EXPECT_EQ(Judged(moved, Predicted(kMuch, kMuch)), DesignVerdict::kGapNarrowed);
  EXPECT_EQ(Judged(moved, Predicted(kMuch, kNothing)), DesignVerdict::kOutsideFamily);
}

TEST(JudgePrediction, UndecidedWhereWindowsTellNeitherWhetherItIsBetterNorWhetherTheFloorIsReached) {
  const Designer moved = MakeDesigner({0.5, 0}, {0.01, 0.01});
  const Estimated unsure_excess = {0.3, 0.6}, unsure_gain = {0.9, 0.7};
  const HeldOutPrediction few = Predicted(unsure_excess, unsure_gain);
  ASSERT_FALSE(IsFloorTold(few));
  EXPECT_EQ(Judged(moved, few), DesignVerdict::kUndecided);
  EXPECT_EQ(JudgePrediction(moved, few, {.asks_for_more = true}), DesignVerdict::kOutsideFamily)
      << "something is surely off";
  EXPECT_EQ(Judged(moved, Predicted(unsure_excess, kMuch)), DesignVerdict::kGapNarrowed) << "it is surely better";
  EXPECT_EQ(Judged(moved, Predicted(kMuch, unsure_gain)), DesignVerdict::kOutsideFamily) << "surely off";
  const HeldOutPrediction worse = Predicted(kMuch, {-0.6, 0.3});
  ASSERT_FALSE(NominalReachesFloor(worse));
  EXPECT_EQ(Judged(moved, worse), DesignVerdict::kUndecided) << "the nominal simulator may be right";
}

TEST(SmallChange, IsATwentiethOfWhatMayBeNoneHoweverWideItsRange) {
  const ParameterSpec friction{.name = "f",
                               .field = "joint/a/frictionloss",
                               .low = 0,
                               .high = 20,
                               .scale = ParameterScale::kAbsolute,
                               .nominal = 0};
  EXPECT_DOUBLE_EQ(SmallChange(friction, 0.9), 0.045);
  EXPECT_DOUBLE_EQ(SmallChange(friction, 0), 0.04);
  EXPECT_DOUBLE_EQ(SmallChange(friction, 15), 0.2);
  const ParameterSpec delay{
      .name = "d", .field = "action/delay", .low = 0, .high = 3, .scale = ParameterScale::kAbsolute};
  EXPECT_DOUBLE_EQ(SmallChange(delay, 0.02), 0.03);
  EXPECT_DOUBLE_EQ(SmallChange({.name = "m", .field = "body/a/mass"}, 1.6), 0.08);
}

TEST(JudgePrediction, LogsThatNobodyPredictsBetterThanTheirMeanEarnNoWord) {
  const Designer q = MakeDesigner({0, 0}, {0.01, 0.01});
  HeldOutPrediction noise = Predicted(kNothing, kNothing);
  for (HeldOutPrediction::Channel& c : noise.horizons[0].channels) c.spread = c.floor = 1;
  EXPECT_TRUE(ShowsNothing(noise.horizons));
  EXPECT_FALSE(ReachesFloor(noise)) << "what cannot be judged has not passed";
  EXPECT_FALSE(LeavesGap(noise)) << "nor is there anything to find";
  EXPECT_TRUE(ChannelsOff(noise).empty());
  EXPECT_EQ(Judged(q, noise), DesignVerdict::kUndecided);
  EXPECT_EQ(JudgePrediction(q, noise, {.asks_for_more = true}), DesignVerdict::kUndecided);
  HeldOutPrediction moves = noise;
  for (HeldOutPrediction::Channel& c : moves.horizons[0].channels) c.floor = 0.1;
  EXPECT_FALSE(ShowsNothing(moves.horizons)) << "a simulator that is right would predict them: a sign may be wrong";
  noise.horizons[0].channels[1].spread = 5;
  EXPECT_FALSE(ShowsNothing(noise.horizons)) << "one channel is predicted";
  EXPECT_EQ(Judged(q, noise), DesignVerdict::kNoGap);
}

TEST(JudgePrediction, AFloorThatGuessesAreFarBelowIsNotReached) {
  // A real double pendulum's swing-up: its own logs, too, were predicted no better than 35 times a guess's error.
  const Designer moved = MakeDesigner({0.5, 0}, {0.01, 0.01});
  HeldOutPrediction prediction = Predicted(kNothing, {0.9, 0.7});
  const auto guess = [&](double error) {
    for (HeldOutPrediction::Channel& c : prediction.horizons[0].channels) c.guess = error;
  };
  guess(0.95);
  EXPECT_TRUE(ReachesFloor(prediction)) << "motion as small as the noise: guesses do as well";
  guess(0.5);
  EXPECT_FALSE(ReachesFloor(prediction));
  EXPECT_TRUE(LeavesGap(prediction)) << "other methods may find it";
  EXPECT_EQ(Judged(moved, prediction), DesignVerdict::kOutsideFamily);
  prediction.horizons.push_back(prediction.horizons[0]);
  prediction.horizons[1].learned = true;
  for (HeldOutPrediction::Channel& c : prediction.horizons[1].channels) c.guess = 10;
  EXPECT_EQ(Judged(moved, prediction), DesignVerdict::kOutsideFamily) << "logs that it learned from";
  prediction.horizons[1].learned = false;
  EXPECT_EQ(Judged(moved, prediction), DesignVerdict::kGapClosed);
}

TEST(JudgePrediction, WhatGuessesSayAsWellIsOutsideTheFamilyHoweverWrongTheNominalSimulatorIs) {
  const Designer q = MakeDesigner({0.5, 0}, {0.01, 0.01});
  HeldOutPrediction better = Predicted(kMuch, kMuch);
  EXPECT_EQ(Judged(q, better), DesignVerdict::kGapNarrowed);
  for (HeldOutPrediction::Channel& c : better.horizons[0].channels) {
    c.designed = 0.1;
    c.guess = 0.05;
  }
  EXPECT_EQ(Judged(q, better), DesignVerdict::kOutsideFamily);
  better.horizons.push_back(better.horizons[0]);  // over which it is better
  for (HeldOutPrediction::Channel& c : better.horizons[1].channels) c.guess = 0.2;
  EXPECT_EQ(Judged(q, better), DesignVerdict::kGapNarrowed);
}

TEST(JudgePrediction, NoGapWhereTheDesignAloneIsOff) {
  const Designer moved = MakeDesigner({0.5, 0}, {0.01, 0.01});
  const HeldOutPrediction worse = Predicted(kMuch, {-kMuch.value, 0.1});
  EXPECT_TRUE(NominalReachesFloor(worse));
  EXPECT_FALSE(LeavesGap(worse));
  EXPECT_EQ(Judged(moved, worse), DesignVerdict::kNoGap);
  const HeldOutPrediction both_off = Predicted(kMuch, {-0.5 * kMuch.value, 0.1});
  EXPECT_FALSE(NominalReachesFloor(both_off));
  EXPECT_EQ(Judged(moved, both_off), DesignVerdict::kOutsideFamily);
}

TEST(JudgePrediction, AnEstimateAtABoundAsksForTheUserUnlessTheFloorIsReached) {
  const ParameterSpace space({{.name = "a", .field = "env/a", .low = 0.5, .high = 2}});
  const Designer stuck(space, Eigen::VectorXd::Constant(1, -6.0), Eigen::MatrixXd::Identity(1, 1));
  EXPECT_EQ(ParametersAtBounds(stuck), std::vector<int>{0});
  EXPECT_EQ(Judged(stuck, Predicted(kMuch, kMuch)), DesignVerdict::kOutsideFamily);
  EXPECT_EQ(Judged(stuck, Predicted(kNothing, kMuch)), DesignVerdict::kGapClosed);
  const ParameterSpace from_nominal({{.name = "a", .field = "env/a", .low = 1, .high = 2}});
  const Designer at_nominal(from_nominal, Eigen::VectorXd::Constant(1, -6.0), Eigen::MatrixXd::Identity(1, 1));
  EXPECT_TRUE(ParametersAtBounds(at_nominal).empty());
}

TEST(JudgePrediction, PredictionsAtTheFloorAreNotTheLastWordWhereTheFitAsksForMore) {
  const Designer moved = MakeDesigner({1, 1}, {0.1, 0.1});
  const HeldOutPrediction better = Predicted(kNothing, kMuch), as_well = Predicted(kNothing, kNothing);
  ASSERT_EQ(Judged(moved, better), DesignVerdict::kGapClosed);
  ASSERT_EQ(Judged(moved, as_well), DesignVerdict::kNoGap);
  EXPECT_EQ(JudgePrediction(moved, better, {.asks_for_more = true}), DesignVerdict::kGapNarrowed);
  EXPECT_EQ(JudgePrediction(moved, as_well, {.asks_for_more = true}), DesignVerdict::kOutsideFamily);
  EXPECT_EQ(JudgePrediction(moved, better, {.fails_in_a_recording = true}), DesignVerdict::kGapNarrowed);
}

TEST(JudgePrediction, NoGapWhereTheNominalParametersCannotBeTold) {
  const HeldOutPrediction at_floor = Predicted(kNothing, kMuch);
  // The 99 % region of two parameters reaches to 3.03 standard deviations.
  EXPECT_EQ(Judged(MakeDesigner({2.9, 0}, {1, 1}), at_floor), DesignVerdict::kNoGap);
  EXPECT_EQ(Judged(MakeDesigner({3.2, 0}, {1, 1}), at_floor), DesignVerdict::kGapClosed);
  EXPECT_EQ(Judged(MakeDesigner({2.9, 2.9}, {1, 1}), at_floor), DesignVerdict::kGapClosed) << "each alone would pass";
  EXPECT_EQ(Judged(MakeDesigner({0.02, 0}, {1e-6, 1e-6}), at_floor), DesignVerdict::kNoGap) << "half a hundredth";
}

TEST(JudgePrediction, ATradeOffDoesNotHideAGap) {
  // Only a + b is known, and it is off: each alone is wide enough to hold its nominal value.
  Eigen::MatrixXd covariance(2, 2);
  covariance << 1, -0.9999, -0.9999, 1;
  const ParameterSpace space = MakeDesigner({0, 0}, {1, 1}).space();
  const auto verdict = [&](double a, double b) {
    return Judged(Designer(space, Eigen::Vector2d(a, b), covariance), Predicted(kNothing, kMuch));
  };
  EXPECT_EQ(verdict(0.5, 0.5), DesignVerdict::kGapClosed);
  EXPECT_EQ(verdict(0.5, -0.5), DesignVerdict::kNoGap);
}

TEST(Verdicts, HaveTheNamesOfDesignJson) {
  EXPECT_EQ(ToString(ParameterVerdict::kIdentified), "identified");
  EXPECT_EQ(ToString(ParameterVerdict::kWeak), "weak");
  EXPECT_EQ(ToString(ParameterVerdict::kNotIdentified), "not_identified");
  EXPECT_EQ(ToString(DesignVerdict::kNoGap), "no_gap");
  EXPECT_EQ(ToString(DesignVerdict::kGapClosed), "gap_closed");
  EXPECT_EQ(ToString(ParameterVerdict::kAtBound), "at_bound");
  EXPECT_EQ(ToString(DesignVerdict::kGapNarrowed), "gap_narrowed");
  EXPECT_EQ(ToString(DesignVerdict::kOutsideFamily), "outside_family");
  EXPECT_EQ(ToString(DesignVerdict::kUndecided), "undecided");
}

TEST(WeakenDoubted, LeavesNothingIdentifiedThatPredictionsOrOwnLogsDoNotBearOut) {
  const ParameterSpace space({{.name = "gain", .field = "env/gain", .low = 0.2, .high = 2.2},
                              {.name = "mass", .field = "env/mass", .low = 0.2, .high = 2.2}});
  // The first is off its nominal value, the second is at it.
  const auto labels = [&](bool can_tell, const std::vector<int>& unsettled) {
    std::vector<ParameterSummary> summaries = {{.mode = 1.3, .std = 0.01, .verdict = ParameterVerdict::kIdentified},
                                               {.mode = 1.0, .std = 0.01, .verdict = ParameterVerdict::kIdentified}};
    WeakenDoubted(space, can_tell, unsettled, summaries);
    return std::pair(summaries[0].verdict, summaries[1].verdict);
  };
  const auto kSure = ParameterVerdict::kIdentified, kWeak = ParameterVerdict::kWeak;
  EXPECT_EQ(labels(true, {}), std::pair(kSure, kSure));
  EXPECT_EQ(labels(false, {}), std::pair(kWeak, kSure));
  EXPECT_EQ(labels(true, {1}), std::pair(kSure, kWeak));
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
