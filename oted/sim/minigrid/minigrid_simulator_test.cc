#include "oted/sim/minigrid/minigrid_simulator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "oted/base/testing.h"
#include "oted/sim/minigrid/solvable_grids.h"
#include "oted/sim/rollout.h"
#include "tests/conformance/simulator_conformance.h"

namespace oted::minigrid_simulator_test {

using minigrid::Cell;
using minigrid::Kind;
using testing::HasSubstr;

ParameterSpec Density(double low = 0, double high = 0.6) {
  return {.name = "density", .field = "env/density", .low = low, .high = high, .scale = ParameterScale::kAbsolute};
}

MinigridTask ObstaclesTask(GridObstacle obstacle = GridObstacle::kWall, bool solvable = true) {
  MinigridTask task = FindMinigridTask("MiniGrid-Obstacles-10x10");
  task.obstacle = obstacle;
  task.solvable = solvable;
  return task;
}

std::unique_ptr<SimulatorFactory> Factory(const MinigridTask& task) {
  return std::make_unique<MinigridSimulatorFactory>(task, std::vector{Density()});
}

INSTANTIATE_TEST_SUITE_P(Minigrid, SimulatorConformance,
                         testing::Values(ConformanceCase{"Wall", [] { return Factory(ObstaclesTask()); }},
                                         ConformanceCase{"Ball",
                                                         [] { return Factory(ObstaclesTask(GridObstacle::kBall)); }},
                                         ConformanceCase{"LavaWholeGridTerminate",
                                                         [] {
                                                           MinigridTask task = ObstaclesTask(GridObstacle::kLava);
                                                           task.observation = GridObservation::kWhole;
                                                           task.collision = GridCollision::kTerminate;
                                                           return Factory(task);
                                                         }}),
                         [](const auto& parameter) { return parameter.param.name; });

// The start of lane 0 at density z, by the stream's number.
const minigrid::State& Start(MinigridSimulator& simulator, double z, uint64_t number) {
  if (simulator.parameters().size() > 0) simulator.SetParameters(0, std::vector{z});
  Rng rng = RngKey(11).Index(number).MakeRng();
  simulator.Reset(0, rng);
  return simulator.state(0);
}

std::vector<uint8_t> ObstaclesOf(const minigrid::State& state, int side) {
  std::vector<uint8_t> room;
  for (int y = 1; y <= side; ++y) {
    for (int x = 1; x <= side; ++x)
      room.push_back(!state.grid.at(x, y).is_empty() && state.grid.at(x, y) != minigrid::kGoal);
  }
  return room;
}

TEST(MinigridSimulator, TheRealisedDensityIsTheParameterBeforeRejectionAndTheExactMeanAfterIt) {
  for (const bool solvable : {false, true}) {
    const auto simulator =
        MinigridSimulatorFactory(ObstaclesTask(GridObstacle::kWall, solvable), {Density(0, 0.95)}).MakeMinigrid(1, 1);
    const minigrid::SolvableGrids& grids = minigrid::SolvableGrids::Of(8);
    // 0.75: beyond what is drawn by rejection alone.
    for (const double z : {0.1, 0.4, 0.75}) {
      const int n = 400;
      double sum = 0, sum_of_squares = 0;
      for (uint64_t i = 0; i < n; ++i) {
        const minigrid::State& state = Start(*simulator, z, i);
        if (solvable) {
          ASSERT_TRUE(minigrid::IsSolvable(8, ObstaclesOf(state, 8)));
        }
        const double realised = simulator->realised_density(0);
        sum += realised;
        sum_of_squares += realised * realised;
      }
      const double mean = sum / n, error = std::sqrt((sum_of_squares / n - mean * mean) / n);
      EXPECT_NEAR(mean, solvable ? grids.MeanRealisedDensity(z) : z, 4 * error) << z;
    }
  }
}

TEST(MinigridSimulator, ACountIsThatManyObstaclesAnywhere) {
  MinigridTask task = ObstaclesTask(GridObstacle::kLava, false);
  task.placement = GridPlacement::kCount;
  const auto simulator = MinigridSimulatorFactory(task, {Density()}).MakeMinigrid(1, 1);
  std::vector<int> at(64, 0);
  for (uint64_t i = 0; i < 2000; ++i) {
    const std::vector<uint8_t> room = ObstaclesOf(Start(*simulator, 0.26, i), 8);
    ASSERT_EQ(std::accumulate(room.begin(), room.end(), 0), 16);  // round(0.26 * 62)
    for (size_t cell = 0; cell < 64; ++cell) at[cell] += room[cell];
  }
  EXPECT_EQ(at.front(), 0);
  EXPECT_EQ(at.back(), 0);
  for (size_t cell = 1; cell < 63; ++cell) EXPECT_NEAR(at[cell], 2000 * 16.0 / 62, 5 * std::sqrt(2000 * 0.19)) << cell;
}

TEST(MinigridSimulator, AnUnsolvableDemandIsAnErrorThatSaysWhatToDo) {
  MinigridTask task = ObstaclesTask();
  task.placement = GridPlacement::kCount;
  const auto simulator = MinigridSimulatorFactory(task, {Density(0, 0.95)}).MakeMinigrid(1, 1);
  EXPECT_THAT(MessageOf<UsageError>([&] { Start(*simulator, 0.9, 1); }), HasSubstr("solvable = false"));
}

TEST(MinigridSimulator, GridsAreMinigridsOwnKinds) {
  const auto start = [](const std::string& name, uint64_t number) {
    const auto simulator = MinigridSimulatorFactory(name, {}).MakeMinigrid(1, 1);
    return Start(*simulator, 0, number);
  };
  const auto count = [](const minigrid::State& state, Kind kind) {
    int n = 0;
    for (int x = 0; x < state.grid.width(); ++x) {
      for (int y = 0; y < state.grid.height(); ++y) n += state.grid.at(x, y).kind() == kind;
    }
    return n;
  };
  std::set<std::pair<int, int>> starts, goals;
  for (uint64_t i = 0; i < 50; ++i) {
    // Five crossings of 9 + 4 x (at most 9, less where rivers cross), each with one opening; always solvable.
    const minigrid::State crossing = start("MiniGrid-SimpleCrossingS11N5-v0", i);
    EXPECT_TRUE(minigrid::IsSolvable(9, ObstaclesOf(crossing, 9)));
    EXPECT_GE(count(crossing, Kind::kWall), 40 + 5 * 9 - 6 - 5);
    EXPECT_LE(count(crossing, Kind::kWall), 40 + 5 * 9 - 4 - 5);
    EXPECT_GT(count(start("MiniGrid-LavaCrossingS9N2-v0", i), Kind::kLava), 10);
    const minigrid::State dynamic = start("MiniGrid-Dynamic-Obstacles-16x16-v0", i);
    EXPECT_EQ(count(dynamic, Kind::kBall), 8);
    EXPECT_EQ(dynamic.balls.size(), 8u);
    // A cross of walls with four gaps (the border has 72).
    const minigrid::State rooms = start("MiniGrid-FourRooms-v0", i);
    EXPECT_EQ(count(rooms, Kind::kWall), 72 + 2 * 17 - 1 - 4);
    EXPECT_EQ(count(rooms, Kind::kGoal), 1);
    starts.insert({rooms.x, rooms.y});
    EXPECT_TRUE(rooms.grid.at(rooms.x, rooms.y).is_empty());
    const minigrid::State random = start("MiniGrid-Empty-Random-5x5-v0", i);
    goals.insert({random.x, random.y});
  }
  EXPECT_GT(starts.size(), 30u);
  EXPECT_EQ(goals.size(), 8u);  // every cell of the room but the goal's
}

TEST(MinigridSimulator, BallsMoveWithinOneCellAndKeepTheirNumber) {
  const auto simulator = MinigridSimulatorFactory("MiniGrid-Dynamic-Obstacles-8x8-v0", {}).MakeMinigrid(1, 1);
  Rng rng(5);
  simulator->Reset(0, rng);
  int moved = 0;
  std::set<std::pair<int, int>> offsets;
  for (int step = 0; step < 250; ++step) {
    const std::vector<minigrid::Position> before = simulator->state(0).balls;
    simulator->Step(std::vector{0}, std::vector{0.0});
    const minigrid::State& state = simulator->state(0);
    ASSERT_EQ(state.balls.size(), 4u);
    for (size_t i = 0; i < 4; ++i) {
      const int dx = state.balls[i].x - before[i].x, dy = state.balls[i].y - before[i].y;
      EXPECT_LE(std::max(std::abs(dx), std::abs(dy)), 1);
      EXPECT_EQ(state.grid.at(state.balls[i].x, state.balls[i].y), minigrid::kBall);
      moved += dx != 0 || dy != 0;
      offsets.insert({dx, dy});
    }
  }
  EXPECT_GT(moved, 990);  // its own cell is occupied by itself: it moves unless it is shut in
  EXPECT_GE(offsets.size(), 8u);
}

TEST(MinigridSimulator, TheCollisionRuleDecidesWhatAWallDoes) {
  for (const bool ends : {false, true}) {
    MinigridTask task = ObstaclesTask();
    task.collision = ends ? GridCollision::kTerminate : GridCollision::kBlock;
    const auto simulator = MinigridSimulatorFactory(task, {}).MakeMinigrid(1, 1);
    minigrid::State state = simulator->state(0);
    state.grid.at(2, 1) = minigrid::kWall;
    simulator->SetState(0, state);
    simulator->Step(std::vector{0}, std::vector{2.0});
    EXPECT_EQ(simulator->state(0).x, 1);
    EXPECT_EQ(simulator->reward(0), ends ? -1 : 0);
    EXPECT_EQ(simulator->status(0), ends ? LaneStatus::kTerminated : LaneStatus::kRunning);
  }
}

TEST(MinigridSimulator, ThousandsOfLanesOnTwoThreadsGiveTheBytesOfOne) {
  const MinigridSimulatorFactory factory(ObstaclesTask(GridObstacle::kBall), {});
  const auto run = [&](int n_threads) {
    const auto simulator = factory.Make(2100, n_threads);
    std::vector<int> lanes;
    for (int lane = 0; lane < 2100; ++lane) {
      Rng rng = RngKey(1).Index(static_cast<uint64_t>(lane)).MakeRng();
      simulator->Reset(lane, rng);
      lanes.push_back(lane);
    }
    Rng rng(2);
    const BatchPolicy policy = UniformRandomPolicy(factory.spec(), rng);
    std::vector<double> actions(lanes.size()), seen;
    for (int step = 0; step < 20; ++step) {
      policy({}, 2100, actions);
      simulator->Step(lanes, actions);
    }
    for (const int lane : lanes)
      seen.insert(seen.end(), simulator->observation(lane).begin(), simulator->observation(lane).end());
    return seen;
  };
  EXPECT_EQ(run(1), run(2));
}

TEST(MinigridSimulator, TheSpecSaysWhatALaneShows) {
  const MinigridSimulatorFactory view(ObstaclesTask(), {Density()});
  EXPECT_EQ(view.spec().image_shape, (std::vector{7, 7, 3}));
  EXPECT_EQ(view.spec().observation_shape, std::vector{148});
  EXPECT_EQ(view.spec().n_discrete_actions, 3);
  EXPECT_EQ(view.spec().max_episode_steps, 400);
  EXPECT_EQ(view.parameters()[0].unit, "probability of an obstacle");
  EXPECT_EQ(view.parameters().Nominal(), std::vector{0.2});
  MinigridTask task = ObstaclesTask();
  task.observation = GridObservation::kWhole;
  EXPECT_EQ(MinigridSimulatorFactory(task, {}).spec().observation_shape, std::vector{301});
  EXPECT_EQ(MinigridSimulatorFactory("MiniGrid-FourRooms-v0", {}).spec().n_discrete_actions, 7);
}

TEST(MinigridSimulator, AMultipleOfTheNominalDensityIsOne) {
  const MinigridSimulatorFactory factory(ObstaclesTask(), {{.name = "density", .field = "env/density", .low = 0.5}});
  const auto simulator = factory.MakeMinigrid(1, 1);
  simulator->SetParameters(0, std::vector{1.5});
  EXPECT_DOUBLE_EQ(simulator->density(0), 0.3);
}

TEST(MinigridSimulator, RequestsThatMakeNoSenseAreErrors) {
  const auto make = [](const MinigridTask& task, const ParameterSpec& spec) {
    return MessageOf<UsageError>([&] { MinigridSimulatorFactory(task, {spec}); });
  };
  EXPECT_THAT(make(ObstaclesTask(), Density(0, 1)), HasSubstr("wanted them in [0, 1)"));
  ParameterSpec other = Density();
  other.field = "env/densty";
  EXPECT_THAT(make(ObstaclesTask(), other), HasSubstr("did you mean 'env/density'"));
  EXPECT_THAT(make(FindMinigridTask("MiniGrid-FourRooms-v0"), Density()), HasSubstr("has no parameter"));
  MinigridTask task = ObstaclesTask();
  EXPECT_THAT(MessageOf<UsageError>([&] { task.Fields().Find("obstacle", "").FromText("cheese", "[task]"); }),
              AllOf(HasSubstr("obstacle"), HasSubstr("cheese"), HasSubstr("lava")));
  task.size = 3;
  EXPECT_THAT(make(task, Density()), HasSubstr("size does not take 3; it takes a number in [4, 32]"));
  EXPECT_THAT(MessageOf<UsageError>([] { FindMinigridTask("MiniGrid-FourRoms-v0"); }),
              HasSubstr("MiniGrid-FourRooms-v0"));
  EXPECT_THAT(MessageOf<UsageError>([] { FindMinigridTask("MiniGrid-Obstacles-99x99"); }), HasSubstr("wanted 4 to 32"));
  const auto simulator = MinigridSimulatorFactory(ObstaclesTask(), {}).MakeMinigrid(1, 1);
  for (const double action : {3.0, -1.0, 0.5, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(simulator->Step(std::vector{0}, std::vector{action}), UsageError) << action;
  }
}

TEST(MinigridTask, EveryNamedTaskMakesASimulatorThatSteps) {
  EXPECT_EQ(MinigridTaskNames().size(), 22u);
  for (const std::string& name : MinigridTaskNames()) {
    const MinigridSimulatorFactory factory(name, {});
    EXPECT_EQ(factory.spec().task, name);
    const auto simulator = factory.Make(1, 1);
    Rng rng(1);
    simulator->Reset(0, rng);
    simulator->Step(std::vector{0}, std::vector{0.0});
    EXPECT_EQ(simulator->status(0), LaneStatus::kRunning);
  }
  EXPECT_EQ(FindMinigridTask("MiniGrid-Obstacles-16x16").size, 16);
}

}  // namespace oted::minigrid_simulator_test
