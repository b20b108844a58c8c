#include "oted/sim/minigrid/expert.h"

#include <gtest/gtest.h>

#include <array>
#include <deque>
#include <map>
#include <set>

#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/task_policy.h"

namespace oted::expert_test {

using minigrid::State;

const ParameterSpec kDensity = {
    .name = "density", .field = "env/density", .low = 0, .high = 0.9, .scale = ParameterScale::kAbsolute};

MinigridTask Task(GridObstacle obstacle, bool solvable) {
  MinigridTask task = FindMinigridTask("MiniGrid-Obstacles-10x10");
  task.obstacle = obstacle;
  task.solvable = solvable;
  return task;
}

// The fewest actions to a reward above 0, by trying every action in the simulator from every state; -1 when none.
int FewestActions(MinigridSimulator& simulator, const State& start) {
  std::map<std::array<int, 3>, int> seen = {{{start.x, start.y, start.direction}, 0}};
  std::deque<State> queue = {start};
  while (!queue.empty()) {
    const State state = queue.front();
    queue.pop_front();
    const int distance = seen.at({state.x, state.y, state.direction});
    for (int action = 0; action < 3; ++action) {
      simulator.SetState(0, state);
      simulator.Step(std::vector{0}, std::vector{static_cast<double>(action)});
      if (simulator.reward(0) > 0) return distance + 1;
      if (simulator.status(0) == LaneStatus::kTerminated) continue;
      State next = simulator.state(0);
      next.step_count = 0;
      if (seen.try_emplace({next.x, next.y, next.direction}, distance + 1).second) queue.push_back(next);
    }
  }
  return ShortestPaths::kUnreachable;
}

TEST(ShortestPaths, AreThoseOfASearchInTheSimulator) {
  int unreachable = 0;
  for (const GridObstacle obstacle : {GridObstacle::kWall, GridObstacle::kLava}) {
    const MinigridSimulatorFactory factory(Task(obstacle, false), {kDensity});
    const auto simulator = factory.MakeMinigrid(1, 1);
    for (uint64_t i = 0; i < 30; ++i) {
      simulator->SetParameters(0, std::vector{0.35});
      Rng rng = RngKey(1).Index(i).MakeRng();
      simulator->Reset(0, rng);
      const State start = simulator->state(0);
      const int wanted = FewestActions(*simulator, start);
      EXPECT_EQ(ShortestPaths(start.grid).Actions(start), wanted);
      unreachable += wanted < 0;
    }
  }
  EXPECT_GT(unreachable, 5);
  EXPECT_LT(unreachable, 55);
}

TEST(MinigridExpert, TakesTheFewestActionsHoweverTiesAreBroken) {
  const MinigridSimulatorFactory factory(Task(GridObstacle::kWall, true), {kDensity});
  int differences = 0;
  const Dataset fixed = CollectMinigridDemonstrations(factory, {0.3}, MinigridExpert(), 50, RngKey(2), 1);
  const Dataset random =
      CollectMinigridDemonstrations(factory, {0.3}, MinigridExpert(TieBreak::kRandom), 50, RngKey(2), 1);
  ASSERT_EQ(fixed.Episodes().size(), 50u);
  const auto simulator = factory.MakeMinigrid(1, 1);
  for (uint64_t i = 0; i < 50; ++i) {
    simulator->SetParameters(0, std::vector{0.3});
    Rng rng = RngKey(2).Index(i).Stage("start").MakeRng();
    simulator->Reset(0, rng);
    const int fewest = ShortestPaths(simulator->state(0).grid).Actions(simulator->state(0));
    EXPECT_EQ(fixed.Episodes()[i].size(), fewest);
    EXPECT_EQ(random.Episodes()[i].size(), fewest);
    EXPECT_NEAR(fixed.EpisodeReturns()[i], 1 - 0.9 * fewest / 400, 1e-7);
    EXPECT_TRUE(fixed.Episodes()[i].terminated);
  }
  for (int row = 0; row < fixed.size(); ++row) differences += fixed.actions(row, 0) != random.actions(row, 0);
  EXPECT_GT(differences, 50);
}

TEST(MinigridExpert, NeverCollidesWithWhatMoves) {
  MinigridTask task = Task(GridObstacle::kBall, true);
  task.collision = GridCollision::kTerminate;
  const Dataset data = CollectMinigridDemonstrations(MinigridSimulatorFactory(task, {kDensity}), {0.2},
                                                     MinigridExpert(), 50, RngKey(3), 1);
  int reached = 0;
  for (const double value : data.EpisodeReturns()) {
    EXPECT_GE(value, 0);
    reached += value > 0;
  }
  EXPECT_GT(reached, 45);
}

TEST(MinigridExpert, WithoutAPathItTurnsOnTheSpot) {
  const auto simulator = MinigridSimulatorFactory(Task(GridObstacle::kLava, false), {}).MakeMinigrid(1, 1);
  State state = simulator->state(0);
  state.grid.at(8, 8) = minigrid::kGoal;
  state.grid.at(8, 7) = state.grid.at(7, 8) = minigrid::kLava;
  Rng rng(1);
  EXPECT_EQ(MinigridExpert()(state, rng), minigrid::kLeft);
  state.grid.at(7, 8) = minigrid::Cell();
  EXPECT_EQ(MinigridExpert()(state, rng), minigrid::kForward);
}

TEST(MinigridMedium, IsTheExpertWithoutMistakesAndSlowerWithThem) {
  const MinigridSimulatorFactory factory(Task(GridObstacle::kWall, true), {kDensity});
  const auto collect = [&](const MinigridPolicy& policy, int n_threads = 1) {
    return CollectMinigridDemonstrations(factory, {0.25}, policy, 40, RngKey(4), n_threads);
  };
  const Dataset expert = collect(MinigridExpert());
  EXPECT_EQ(collect(MinigridMedium(0)).observations, expert.observations);
  const Dataset medium = collect(MinigridMedium());
  EXPECT_GT(medium.size(), 1.3 * expert.size());
  EXPECT_LT(medium.size(), 2.5 * expert.size());
  EXPECT_GT(collect(MinigridMedium(1)).size(), 5 * medium.size());
  EXPECT_EQ(collect(MinigridMedium(), 2).observations, medium.observations);
  EXPECT_THROW(MinigridMedium(1.5), UsageError);
}

TEST(OnTrueStates, InRunEpisodesTheExpertTakesTheShortestPathOfEachLanesOwnGrid) {
  const MinigridSimulatorFactory factory(Task(GridObstacle::kWall, true), {kDensity});
  constexpr int kLanes = 12;
  const std::vector<std::vector<double>> z(kLanes, {0.3});
  const RngKey key(8);
  const auto simulator = factory.MakeMinigrid(kLanes, 1);
  const auto episodes = RunEpisodes(*simulator, z, OnTrueStates(*simulator, TaskPolicy::kExpert, Rng(1)), key);
  const auto starts = factory.MakeMinigrid(kLanes, 1);
  std::set<int> lengths;
  for (int lane = 0; lane < kLanes; ++lane) {
    starts->SetParameters(lane, z[0]);
    Rng rng = key.Index(static_cast<uint64_t>(lane)).MakeRng();
    starts->Reset(lane, rng);
    const EpisodeResult& episode = episodes[static_cast<size_t>(lane)];
    EXPECT_EQ(episode.n_steps, ShortestPaths(starts->state(lane).grid).Actions(starts->state(lane)));
    EXPECT_EQ(episode.end, LaneStatus::kTerminated);
    lengths.insert(episode.n_steps);
  }
  EXPECT_GT(lengths.size(), 1u) << "lanes that end at different times are the case";
}

TEST(CollectTaskPolicy, LogsTheGridsOwnPoliciesAlsoBehindAnActionDelay) {
  const MinigridSimulatorFactory factory(Task(GridObstacle::kWall, true), {kDensity});
  const auto collect = [](const SimulatorFactory& from, std::vector<double> z, TaskPolicy policy) {
    return CollectTaskPolicy(from, z, policy, 10, RngKey(4), 1);
  };
  for (const auto& [name, policy] : {std::pair("expert", MinigridExpert()), std::pair("medium", MinigridMedium())}) {
    const Dataset direct = CollectMinigridDemonstrations(factory, {0.25}, policy, 10, RngKey(4), 1);
    EXPECT_EQ(collect(factory, {0.25}, TaskPolicyNamed(name)).actions, direct.actions) << name;
  }
  const ParameterSpec delay = {
      .name = "delay", .field = "action/delay", .low = 0, .high = 2, .scale = ParameterScale::kAbsolute};
  const auto delayed = WithChannels({kDensity, delay}, [](std::vector<ParameterSpec> own) {
    return std::make_unique<MinigridSimulatorFactory>(Task(GridObstacle::kWall, true), std::move(own));
  });
  EXPECT_TRUE(delayed->has_expert());
  EXPECT_EQ(delayed->why_not_settable(), factory.why_not_settable());
  EXPECT_EQ(collect(*delayed, {0.25, 0}, TaskPolicy::kExpert).observations,
            collect(factory, {0.25}, TaskPolicy::kExpert).observations);
  EXPECT_THROW(TaskPolicyNamed("best"), UsageError);
}

TEST(CollectMinigridDemonstrations, ComesBackFromAFileAsItWas) {
  const MinigridSimulatorFactory factory(Task(GridObstacle::kWall, true), {kDensity});
  const Dataset data = CollectMinigridDemonstrations(factory, {0.25}, MinigridMedium(), 3, RngKey(5), 1);
  data.Check();
  data.CheckFits(factory.spec().task, 148, 1);
  const TestFolder folder;
  WriteDataset(data, folder / "demos.hdf5");
  const Dataset read = ReadDataset(folder / "demos.hdf5");
  EXPECT_EQ(read.observations, data.observations);
  EXPECT_EQ(read.next_observations, data.next_observations);
  EXPECT_EQ(read.actions, data.actions);
  EXPECT_EQ(read.rewards, data.rewards);
  EXPECT_EQ(read.terminals, data.terminals);
}

}  // namespace oted::expert_test
