#include "oted/sim/one_step.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/sim/testing.h"

namespace oted::one_step_test {

/// 20 episodes of the point mass with this gain, under random actions that take effect `delay` rows late.
Dataset Log(double gain, int delay = 0, const PointMassOptions& options = {}) {
  PointMass simulator(options, 1, 1);
  simulator.SetParameters(0, std::vector<double>{gain, 1.0, 0.5});
  Rng rng(5);
  Dataset d;
  const std::vector<int> lane = {0};
  for (int e = 0; e < 20; ++e) {
    simulator.Reset(0, rng);
    std::vector<double> actions;
    for (int t = 0; t < 15; ++t) {
      actions.push_back(rng.Uniform(-1, 1));
      d.observations.AppendRow(simulator.observation(0));
      d.actions.AppendRow(std::vector<double>{actions.back()});
      const double acting = t >= delay ? actions[static_cast<size_t>(t - delay)] : 0.0;
      simulator.Step(lane, std::vector<double>{acting});
      d.next_observations.AppendRow(simulator.observation(0));
      d.terminals.push_back(simulator.status(0) == LaneStatus::kTerminated);
      d.timeouts.push_back(t == 14 && !d.terminals.back());
      if (d.terminals.back()) break;
    }
  }
  return d;
}

TEST(OneStep, TheLogsOwnSimulatorMissesNothing) {
  const OneStepError e = MeasureOneStep(PointMassFactory(), Log(1.0), 1000, 1);
  EXPECT_EQ(e.n_rows, 300);
  EXPECT_EQ(e.rms_error, (std::vector<double>{0, 0}));
  EXPECT_EQ(e.median_ratio, 0);
}

TEST(OneStep, TheErrorIsThatOfTheGain) {
  // v' = gain a: the nominal v' is short by 0.3 a, and x' by a tenth of that.
  const Dataset d = Log(1.3);
  const OneStepError e = MeasureOneStep(PointMassFactory(), d, 1000, 2);
  double square = 0;
  for (int i = 0; i < d.size(); ++i) square += d.actions(i, 0) * d.actions(i, 0) / d.size();
  EXPECT_NEAR(e.rms_error[1], 0.3 * std::sqrt(square), 1e-12);
  EXPECT_NEAR(e.rms_error[0], 0.03 * std::sqrt(square), 1e-12);
}

TEST(OneStep, ADelayShowsAsTheBestShiftWhateverTheGain) {
  for (const double gain : {1.0, 0.4, 2.0}) {
    for (const int delay : {0, 1, 2}) {
      const auto ratio = MeasureOneStep(PointMassFactory(), Log(gain, delay), 1000, 1).ratio_by_shift;
      ASSERT_EQ(ratio.size(), 5u);
      EXPECT_LT(ratio.at(-delay), 0.05) << gain << " " << delay;
      for (const auto& [shift, value] : ratio) EXPECT_TRUE(shift == -delay || value > 0.3) << delay << " " << shift;
    }
  }
}

TEST(BetterShift, IsTheBestOneWhereItLeavesLittleEnoughOfTheError) {
  OneStepError e;
  EXPECT_FALSE(BetterShift(e, 0.5)) << "too few rows";
  e.ratio_by_shift = {{-1, 0.3}, {0, 0.8}, {1, 0.5}};
  const auto better = BetterShift(e, 0.5);
  ASSERT_TRUE(better);
  EXPECT_EQ(better->shift, -1);
  EXPECT_EQ(better->error, 0.3);
  EXPECT_EQ(better->own, 0.8);
  EXPECT_FALSE(BetterShift(e, 0.3));
  e.ratio_by_shift = {{-1, 0.3}, {0, 0.2}, {1, 0.5}};
  EXPECT_FALSE(BetterShift(e, 0.9)) << "its own action is the best";
}

TEST(OneStep, RowsWhoseStateIsUnknownAreCountedAndLeftOut) {
  PointMassOptions clipped;
  clipped.velocity_clip = 0.5;
  const Dataset d = Log(1.0, 0, clipped);
  int n_clipped = 0;
  for (int i = 0; i < d.size(); ++i) n_clipped += std::abs(d.observations(i, 1)) >= 0.5;
  const OneStepError e = MeasureOneStep(PointMassFactory(clipped), d, 1000, 1);
  EXPECT_GT(n_clipped, 20);
  EXPECT_EQ(e.n_unsettable, n_clipped);
  EXPECT_EQ(e.n_rows, d.size() - n_clipped);
}

TEST(OneStep, TerminalsAreHeldAgainstTheTasksRule) {
  PointMassOptions options;
  options.terminate_beyond = 0.9;
  Dataset d = Log(1.0, 0, options);
  const PointMassFactory factory(options);
  const TerminalAgreement clean = CompareTerminals(factory, d, {0, 0}, 1000, RngKey(1));
  EXPECT_EQ(clean.n_known, d.size());
  EXPECT_EQ(clean.n_unexplained, 0);
  EXPECT_EQ(clean.n_missed, 0);

  const auto first = std::find(d.terminals.begin(), d.terminals.end(), 1) - d.terminals.begin();
  ASSERT_LT(first, d.size());
  const Dataset clean_log = d;
  d.terminals[static_cast<size_t>(first)] = 0;
  const auto calm = std::find(d.timeouts.begin(), d.timeouts.end(), 1) - d.timeouts.begin();
  ASSERT_LT(calm, d.size());
  d.terminals[static_cast<size_t>(calm)] = 1;
  const TerminalAgreement broken = CompareTerminals(factory, d, {0, 0}, 1000, RngKey(1));
  EXPECT_EQ(broken.n_missed, 1);
  EXPECT_EQ(broken.first_missed, first);
  EXPECT_EQ(broken.n_unexplained, 1);
  EXPECT_EQ(broken.first_unexplained, calm);

  Dataset near = clean_log;
  near.next_observations(static_cast<int>(first), 0) =
      std::copysign(0.88, near.next_observations(static_cast<int>(first), 0));
  EXPECT_EQ(CompareTerminals(factory, near, {0, 0}, 1000, RngKey(1)).n_unexplained, 1);
  EXPECT_EQ(CompareTerminals(factory, near, {0.02, 0}, 1000, RngKey(1)).n_unexplained, 0) << "noise can have moved it";
  EXPECT_EQ(CompareTerminals(factory, near, {0.001, 0}, 1000, RngKey(1)).n_unexplained, 1) << "not so little";
}

}  // namespace oted::one_step_test
