#pragma once
/// What every Simulator must hold. Include it in a test program and instantiate it with the simulators at hand:
///
///   INSTANTIATE_TEST_SUITE_P(Mujoco, SimulatorConformance, testing::Values(ConformanceCase{"Hopper", [] { ... }}));
///
/// The factory of a case needs at least one parameter, and one that has an effect within a few steps.

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <numeric>
#include <ostream>
#include <string>
#include <vector>

#include "oted/base/error.h"
#include "oted/sim/simulator.h"

namespace oted {

struct ConformanceCase {
  std::string name;
  std::function<std::unique_ptr<SimulatorFactory>()> make_factory;
};
inline void PrintTo(const ConformanceCase& c, std::ostream* out) { *out << c.name; }

class SimulatorConformance : public testing::TestWithParam<ConformanceCase> {
 protected:
  using Record = std::vector<double>;

  void SetUp() override {
    factory_ = GetParam().make_factory();
    ASSERT_GE(factory_->parameters().size(), 1);
  }

  const SimulatorSpec& spec() const { return factory_->spec(); }

  // What a lane shows: observation, reward, status.
  static void Append(const Simulator& simulator, int lane, Record& record) {
    record.insert(record.end(), simulator.observation(lane).begin(), simulator.observation(lane).end());
    record.push_back(simulator.reward(lane));
    record.push_back(static_cast<double>(simulator.status(lane)));
  }

  // One action per lane; lane i's depends on its `ids[i]` and the step alone.
  std::vector<double> Actions(const std::vector<int>& ids, int step) const {
    std::vector<double> actions;
    for (int id : ids) {
      Rng rng = RngKey(7).Index(static_cast<uint64_t>(id)).Index(static_cast<uint64_t>(step)).MakeRng();
      for (int k = 0; k < spec().act_dim; ++k) {
        const size_t i = static_cast<size_t>(k);
        actions.push_back(spec().n_discrete_actions > 0
                              ? static_cast<double>(rng.Below(static_cast<uint64_t>(spec().n_discrete_actions)))
                              : rng.Uniform(spec().action_low[i], spec().action_high[i]));
      }
    }
    return actions;
  }

  std::vector<double> ParametersOf(int id) const {
    Rng rng = RngKey(8).Index(static_cast<uint64_t>(id)).MakeRng();
    return factory_->parameters().SampleUniform(rng);
  }

  // Lane i runs the episode named ids[i]. One record per lane.
  std::vector<Record> Rollout(Simulator& simulator, const std::vector<int>& ids, int n_steps) const {
    std::vector<Record> records(ids.size());
    std::vector<int> lanes(ids.size());
    std::iota(lanes.begin(), lanes.end(), 0);
    for (int lane : lanes) {
      const int id = ids[static_cast<size_t>(lane)];
      simulator.SetParameters(lane, ParametersOf(id));
      Rng rng = RngKey(9).Index(static_cast<uint64_t>(id)).MakeRng();
      simulator.Reset(lane, rng);
      Append(simulator, lane, records[static_cast<size_t>(lane)]);
    }
    for (int step = 0; step < n_steps; ++step) {
      simulator.Step(lanes, Actions(ids, step));
      for (int lane : lanes) Append(simulator, lane, records[static_cast<size_t>(lane)]);
    }
    return records;
  }

  std::unique_ptr<SimulatorFactory> factory_;
};

TEST_P(SimulatorConformance, SpecHasConsistentShapes) {
  EXPECT_GT(spec().obs_dim(), 0);
  EXPECT_GT(spec().act_dim, 0);
  if (spec().n_discrete_actions == 0) {
    EXPECT_EQ(static_cast<int>(spec().action_low.size()), spec().act_dim);
    EXPECT_EQ(static_cast<int>(spec().action_high.size()), spec().act_dim);
  }
  if (!spec().observation_names.empty()) {
    EXPECT_EQ(static_cast<int>(spec().observation_names.size()), spec().obs_dim());
  }
  if (!spec().action_names.empty()) {
    EXPECT_EQ(static_cast<int>(spec().action_names.size()), spec().act_dim);
  }
  const std::unique_ptr<Simulator> simulator = factory_->Make(3, 1);
  EXPECT_EQ(simulator->n_lanes(), 3);
  EXPECT_EQ(static_cast<int>(simulator->observation(2).size()), spec().obs_dim());
}

TEST_P(SimulatorConformance, EqualKeysGiveEqualStartsAndDifferentKeysDifferentOnes) {
  const std::unique_ptr<Simulator> simulator = factory_->Make(3, 1);
  for (int lane = 0; lane < 3; ++lane) {
    Rng rng = RngKey(lane == 2 ? 2 : 1).MakeRng();
    simulator->Reset(lane, rng);
  }
  const auto start = [&](int lane) {
    return Record(simulator->observation(lane).begin(), simulator->observation(lane).end());
  };
  EXPECT_EQ(start(0), start(1));
  EXPECT_NE(start(0), start(2));
}

TEST_P(SimulatorConformance, ALaneDoesNotDependOnItsPlaceOrItsNeighbours) {
  const auto together = Rollout(*factory_->Make(5, 1), {0, 1, 2, 3, 4}, 60);
  const auto shuffled = Rollout(*factory_->Make(3, 1), {3, 7, 1}, 60);
  const auto alone = Rollout(*factory_->Make(1, 1), {3}, 60);
  EXPECT_EQ(together[3], alone[0]);
  EXPECT_EQ(together[3], shuffled[0]);
  EXPECT_EQ(together[1], shuffled[2]);
  EXPECT_NE(together[1], together[3]);
}

TEST_P(SimulatorConformance, OneAndTwoThreadsGiveTheSameBytes) {
  std::vector<int> ids(17);
  std::iota(ids.begin(), ids.end(), 0);
  EXPECT_EQ(Rollout(*factory_->Make(17, 1), ids, 60), Rollout(*factory_->Make(17, 2), ids, 60));
}

TEST_P(SimulatorConformance, AUsedSimulatorGivesTheSameBytesAsANewOne) {
  const std::unique_ptr<Simulator> used = factory_->Make(2, 1);
  Rollout(*used, {5, 6}, 30);
  EXPECT_EQ(Rollout(*used, {0, 1}, 30), Rollout(*factory_->Make(2, 1), {0, 1}, 30));
}

TEST_P(SimulatorConformance, LanesThatAreNotListedStayAsTheyAre) {
  const std::unique_ptr<Simulator> simulator = factory_->Make(2, 1);
  Rollout(*simulator, {0, 1}, 5);
  Record before, after;
  Append(*simulator, 1, before);
  const int listed = 0;
  simulator->Step({&listed, 1}, Actions({0, 1}, 5));
  Append(*simulator, 1, after);
  EXPECT_EQ(before, after);
}

TEST_P(SimulatorConformance, ParametersActAndApplyingThemTwiceIsApplyingThemOnce) {
  const auto run = [&](const std::vector<int>& parameter_ids) {
    const std::unique_ptr<Simulator> simulator = factory_->Make(1, 1);
    for (int id : parameter_ids) simulator->SetParameters(0, ParametersOf(id));
    Record record;
    const int lane = 0;
    Rng rng = RngKey(1).MakeRng();
    simulator->Reset(lane, rng);
    for (int step = 0; step < 60; ++step) {
      simulator->Step({&lane, 1}, Actions({0}, step));
      Append(*simulator, lane, record);
    }
    return record;
  };
  EXPECT_EQ(run({1}), run({1, 1}));
  EXPECT_EQ(run({1}), run({2, 3, 1}));
  EXPECT_NE(run({1}), run({2}));
}

TEST_P(SimulatorConformance, NominalParametersAreTheUntouchedSimulator) {
  const auto run = [&](bool set) {
    const std::unique_ptr<Simulator> simulator = factory_->Make(1, 1);
    if (set) simulator->SetParameters(0, ParametersOf(1));
    if (set) simulator->SetParameters(0, factory_->parameters().Nominal());
    Record record;
    const int lane = 0;
    Rng rng = RngKey(1).MakeRng();
    simulator->Reset(lane, rng);
    for (int step = 0; step < 60; ++step) {
      simulator->Step({&lane, 1}, Actions({0}, step));
      Append(*simulator, lane, record);
    }
    return record;
  };
  EXPECT_EQ(run(false), run(true));
}

TEST_P(SimulatorConformance, ParametersOutsideTheirBoundsAreErrors) {
  const std::unique_ptr<Simulator> simulator = factory_->Make(1, 1);
  std::vector<double> z = factory_->parameters().Nominal();
  z[0] = factory_->parameters()[0].high * (1 + 1e-9) + 1e-9;
  EXPECT_THROW(simulator->SetParameters(0, z), UsageError);
  z.push_back(1);
  EXPECT_THROW(simulator->SetParameters(0, z), UsageError);
}

TEST_P(SimulatorConformance, AStateSetFromAnObservationShowsItAndStartsAnEpisode) {
  const std::unique_ptr<Simulator> simulator = factory_->Make(2, 1);
  Rollout(*simulator, {0, 1}, 3);
  const std::vector<double> seen(simulator->observation(0).begin(), simulator->observation(0).end());
  if (!spec().can_set_state) {
    EXPECT_THROW(simulator->SetStateFromObservation(1, seen), UsageError);
    return;
  }
  ASSERT_TRUE(simulator->SetStateFromObservation(1, seen));
  EXPECT_EQ(seen, std::vector<double>(simulator->observation(1).begin(), simulator->observation(1).end()));
  EXPECT_EQ(simulator->status(1), LaneStatus::kRunning);
  // What happens next is a function of the observation alone.
  const auto next = [&] {
    const int lane = 1;
    Record record;
    for (int step = 0; step < 5; ++step) {
      simulator->Step({&lane, 1}, Actions({0, 1}, step));
      Append(*simulator, lane, record);
    }
    return record;
  };
  const Record first = next();
  ASSERT_TRUE(simulator->SetStateFromObservation(1, seen));
  EXPECT_EQ(first, next());
}

TEST_P(SimulatorConformance, TheClockTruncatesALaneThatDoesNotEndEarlier) {
  if (spec().max_episode_steps == 0) GTEST_SKIP() << "no time limit";
  const std::unique_ptr<Simulator> simulator = factory_->Make(1, 1);
  const int lane = 0;
  Rng rng = RngKey(1).MakeRng();
  simulator->Reset(lane, rng);
  for (int step = 1; step <= spec().max_episode_steps; ++step) {
    simulator->Step({&lane, 1}, Actions({0}, step));
    const LaneStatus status = simulator->status(lane);
    ASSERT_EQ(status == LaneStatus::kTruncated, status != LaneStatus::kTerminated && step == spec().max_episode_steps);
    if (status == LaneStatus::kTerminated) {
      simulator->Reset(lane, rng);
      EXPECT_EQ(simulator->status(lane), LaneStatus::kRunning);
      return;
    }
  }
}

TEST_P(SimulatorConformance, WhatTheFactorySaysItCanDoItsSimulatorsDo) {
  const std::unique_ptr<Simulator> simulator = factory_->Make(1, 1);
  Rng rng = RngKey(1).MakeRng();
  simulator->Reset(0, rng);
  EXPECT_EQ(simulator->pose_rates(0).size(), simulator->pose(0).size());
  std::string why_not;
  const std::unique_ptr<Renderer> renderer = factory_->MakeRenderer(32, 32, &why_not);
  if (renderer == nullptr) {
    EXPECT_NE(why_not, "") << "it cannot be drawn, and nobody is told why";
  } else {
    EXPECT_EQ(renderer->Draw(ParametersOf(0), simulator->pose(0)).size(), 3u * 32 * 32);
  }
  EXPECT_TRUE(!spec().can_set_state || factory_->why_not_settable().empty());
  std::vector<double> action(static_cast<size_t>(spec().act_dim));
  if (factory_->has_expert()) {
    simulator->TakeTaskPolicy(TaskPolicy::kExpert, 0, rng, action);
    for (size_t k = 0; k < action.size(); ++k) {
      EXPECT_GE(action[k], spec().action_low[k]);
      EXPECT_LE(action[k], spec().action_high[k]);
    }
  } else {
    EXPECT_THROW(simulator->TakeTaskPolicy(TaskPolicy::kExpert, 0, rng, action), UsageError);
  }
}

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(SimulatorConformance);

}  // namespace oted
