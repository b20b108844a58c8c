#include "oted/stages/design/effects.h"

#include <gtest/gtest.h>

#include "oted/matching/testing.h"
#include "oted/sim/testing.h"

namespace oted::effects_test {

const std::vector<double> kNominal = {1, 1, 1};

/// A point mass whose third parameter shifts the start of a reset, and nothing else.
class ShiftedStart : public PointMass {
 public:
  using PointMass::PointMass;
  void SetParameters(int lane, std::span<const double> z) override {
    PointMass::SetParameters(lane, z);
    shift_.resize(static_cast<size_t>(n_lanes()));
    shift_[static_cast<size_t>(lane)] = z[2];
  }
  void Reset(int lane, Rng& rng) override {
    PointMass::Reset(lane, rng);
    const std::vector<double> start = {observation(lane)[0] + shift_[static_cast<size_t>(lane)], 0};
    PointMass::SetStateFromObservation(lane, start);
  }

 private:
  std::vector<double> shift_;
};

class ShiftedStartFactory : public PointMassFactory {
 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<ShiftedStart>(PointMassOptions{}, n_lanes, n_threads);
  }
};

/// The same where a shift in either direction is one to the right, of as much.
class ShiftedAsideFactory : public PointMassFactory {
  class ShiftedAside : public ShiftedStart {
   public:
    using ShiftedStart::ShiftedStart;
    void SetParameters(int lane, std::span<const double> z) override {
      ShiftedStart::SetParameters(lane, std::vector<double>{z[0], z[1], std::min(std::abs(z[2] - kNominal[2]), 0.1)});
    }
  };

 public:
  std::unique_ptr<Simulator> Make(int n_lanes, int n_threads) const override {
    return std::make_unique<ShiftedAside>(PointMassOptions{}, n_lanes, n_threads);
  }
};

TEST(MeasureEffects, WhatActsAlikeAtBothBoundsDiffersFromTheNominalValue) {
  const auto effects = MeasureEffects(ShiftedAsideFactory(), PointMassLogs(kNominal, 3), 3, RngKey(1), 1);
  EXPECT_GT(effects[2].largest_change, 1e-3);
}

TEST(MeasureEffects, AParameterThatChangesNothingMeasuresExactlyZero) {
  const auto effects = MeasureEffects(PointMassFactory(), PointMassLogs(kNominal, 3), 3, RngKey(1), 1);
  ASSERT_EQ(effects.size(), 3u);
  EXPECT_GT(effects[0].largest_change, 0.1) << "gain";
  EXPECT_GT(effects[1].largest_change, 0.1) << "damping";
  EXPECT_EQ(effects[2].largest_change, 0.0) << "idle";
}

TEST(HaveEffects, TheyAreThoseThatAreMeasuredThoughTheSearchEndsSooner) {
  EXPECT_EQ(HaveEffects(PointMassFactory(), PointMassLogs(kNominal, 3), 3, RngKey(1), 1),
            (std::vector<bool>{true, true, false}));
  // From a start where nothing moves before the logged actions do: the first rows show nothing.
  Dataset logs = PointMassLogs(kNominal, 2);
  for (int i = 0; i < logs.size(); ++i) {
    if (i + 1 < logs.Episodes().front().end) logs.actions(i, 0) = 0;
  }
  EXPECT_EQ(HaveEffects(ShiftedStartFactory(), logs, 2, RngKey(1), 1), (std::vector<bool>{true, true, true}));
}

TEST(MeasureEffects, ResetsCount) {
  const Dataset logs = PointMassLogs(kNominal, 3);
  EXPECT_GT(MeasureEffects(ShiftedStartFactory(), logs, 3, RngKey(1), 1)[2].largest_change, 0.5);
}

TEST(MeasureEffects, ResetsAloneAreEnoughWhereNoStateCanBeSet) {
  const PointMassOptions options{.can_set_state = false};
  const auto effects = MeasureEffects(PointMassFactory(options), PointMassLogs(kNominal, 2), 2, RngKey(1), 1);
  EXPECT_GT(effects[0].largest_change, 0.1);
  EXPECT_EQ(effects[2].largest_change, 0.0);
}

TEST(MeasureEffects, APhysicsThatBreaksAtOneBoundIsAnEffect) {
  // x stays below 1.5 at the lower gain and does not at the upper one.
  const PointMassOptions options{.diverge_beyond = 1.5};
  const auto effects = MeasureEffects(PointMassFactory(options), PointMassLogs(kNominal, 5), 5, RngKey(1), 1);
  EXPECT_GT(effects[0].largest_change, 1e6);
  EXPECT_EQ(effects[2].largest_change, 0.0);
}

TEST(MeasureEffects, APhysicsThatBreaksAlikeAtBothBoundsIsNone) {
  const PointMassOptions options{.diverge_beyond = 0.5};
  const auto effects = MeasureEffects(PointMassFactory(options), PointMassLogs(kNominal, 5), 5, RngKey(1), 1);
  EXPECT_EQ(effects[2].largest_change, 0.0);
}

TEST(MeasureEffects, DoesNotDependOnThreads) {
  const Dataset logs = PointMassLogs(kNominal, 3);
  const auto one = MeasureEffects(PointMassFactory(), logs, 3, RngKey(1), 1);
  const auto three = MeasureEffects(PointMassFactory(), logs, 3, RngKey(1), 3);
  for (size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].largest_change, three[i].largest_change);
}

}  // namespace oted::effects_test
