// Environment steps per second of the grid worlds: uniformly random actions of turning and going forward, resets
// included, one thread. benchmarks/minigrid_speed.py runs this beside the Python package, interleaved.
// items_per_second counts steps of one lane.

#include <benchmark/benchmark.h>

#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "oted/base/rng.h"
#include "oted/sim/minigrid/minigrid_simulator.h"

namespace oted {
namespace {

constexpr size_t kSteps = 256;

void Step(benchmark::State& state, const std::string& task_name, bool see_through_walls) {
  const int n_lanes = static_cast<int>(state.range(0));
  MinigridTask task = FindMinigridTask(task_name);
  task.see_through_walls = see_through_walls;
  const auto simulator = MinigridSimulatorFactory(task, {}).Make(n_lanes, 1);
  Rng rng(1);
  std::vector<int> lanes(static_cast<size_t>(n_lanes));
  std::iota(lanes.begin(), lanes.end(), 0);
  for (const int lane : lanes) simulator->Reset(lane, rng);
  std::vector<double> actions(kSteps * lanes.size());
  for (double& action : actions) action = static_cast<double>(rng.Below(3));
  for (auto _ : state) {
    for (size_t step = 0; step < kSteps; ++step) {
      simulator->Step(lanes, std::span(actions).subspan(step * lanes.size(), lanes.size()));
      for (const int lane : lanes) {
        if (simulator->status(lane) != LaneStatus::kRunning) simulator->Reset(lane, rng);
      }
      benchmark::DoNotOptimize(simulator->observation(0).data());
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<int64_t>(kSteps) * n_lanes);
}

BENCHMARK_CAPTURE(Step, Obstacles10x10, "MiniGrid-Obstacles-10x10", false)->Arg(1)->Arg(64)->ArgName("lanes");
BENCHMARK_CAPTURE(Step, Obstacles10x10_see_through, "MiniGrid-Obstacles-10x10", true)->Arg(64)->ArgName("lanes");
BENCHMARK_CAPTURE(Step, Empty8x8, "MiniGrid-Empty-8x8-v0", true)->Arg(64)->ArgName("lanes");
BENCHMARK_CAPTURE(Step, FourRooms, "MiniGrid-FourRooms-v0", false)->Arg(64)->ArgName("lanes");
BENCHMARK_CAPTURE(Step, DynamicObstacles8x8, "MiniGrid-Dynamic-Obstacles-8x8-v0", true)->Arg(64)->ArgName("lanes");

}  // namespace
}  // namespace oted
