// What our Step costs over a bare loop of mj_step on the same model, with the same actions, from the same states.
// Run: bench_simulator --benchmark_enable_random_interleaving=true --benchmark_repetitions=15
// items_per_second counts control steps of one lane; both sides restart every 50 control steps.

#include <benchmark/benchmark.h>
#include <mujoco/mujoco.h>

#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "oted/base/rng.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/mujoco/task.h"

namespace oted {
namespace {

constexpr int kSteps = 50;

std::vector<double> Actions(int n, uint64_t seed) {
  Rng rng(seed);
  std::vector<double> actions(static_cast<size_t>(n));
  for (double& a : actions) a = rng.Uniform(-1, 1);
  return actions;
}

// Start states of the lanes, as the simulator draws them.
std::vector<std::vector<double>> StartStates(MujocoSimulator& simulator) {
  std::vector<std::vector<double>> states;
  for (int lane = 0; lane < simulator.n_lanes(); ++lane) {
    Rng rng = RngKey(1).Index(static_cast<uint64_t>(lane)).MakeRng();
    simulator.Reset(lane, rng);
    states.emplace_back(simulator.IntegrationState(lane).begin(), simulator.IntegrationState(lane).end());
  }
  return states;
}

void BareLoop(benchmark::State& state, const std::string& task_name) {
  const int n_lanes = static_cast<int>(state.range(0));
  const MujocoSimulatorFactory factory(task_name, {});
  const auto states = StartStates(*factory.MakeMujoco(n_lanes, 1));
  const LoadedModel loaded = LoadModel(factory.model_path());
  const mjModel* model = loaded.model.get();
  std::vector<DataPtr> lanes;
  for (int i = 0; i < n_lanes; ++i) lanes.emplace_back(mj_makeData(model));
  const int act_dim = factory.spec().act_dim;
  const std::vector<double> actions = Actions(kSteps * n_lanes * act_dim, 2);
  for (auto _ : state) {
    for (int i = 0; i < n_lanes; ++i) {
      mj_setState(model, lanes[static_cast<size_t>(i)].get(), states[static_cast<size_t>(i)].data(),
                  mjSTATE_INTEGRATION);
    }
    for (int step = 0; step < kSteps; ++step) {
      for (int i = 0; i < n_lanes; ++i) {
        mjData* data = lanes[static_cast<size_t>(i)].get();
        mju_copy(data->ctrl, actions.data() + (step * n_lanes + i) * act_dim, act_dim);
        for (int k = 0; k < factory.frame_skip(); ++k) mj_step(model, data);
      }
    }
  }
  state.SetItemsProcessed(state.iterations() * kSteps * n_lanes);
}

void OurStep(benchmark::State& state, const std::string& task_name) {
  const int n_lanes = static_cast<int>(state.range(0));
  const MujocoSimulatorFactory factory(task_name, {{.name = "friction", .field = "geom/*/friction[0]"},
                                                   {.name = "gain", .field = "actuator/*/gainprm[0]"},
                                                   {.name = "gravity", .field = "opt/gravity[2]"}});
  const std::unique_ptr<MujocoSimulator> simulator = factory.MakeMujoco(n_lanes, static_cast<int>(state.range(1)));
  const auto states = StartStates(*simulator);
  for (int i = 0; i < n_lanes; ++i) simulator->SetParameters(i, std::vector{1.0, 1.0, 1.0});
  std::vector<int> lanes(static_cast<size_t>(n_lanes));
  std::iota(lanes.begin(), lanes.end(), 0);
  const size_t row = static_cast<size_t>(n_lanes * factory.spec().act_dim);
  const std::vector<double> actions = Actions(kSteps * static_cast<int>(row), 2);
  for (auto _ : state) {
    for (int i = 0; i < n_lanes; ++i) simulator->SetIntegrationState(i, states[static_cast<size_t>(i)]);
    for (size_t step = 0; step < kSteps; ++step) {
      simulator->Step(lanes, std::span(actions).subspan(step * row, row));
      benchmark::DoNotOptimize(simulator->reward(0));
    }
  }
  state.SetItemsProcessed(state.iterations() * kSteps * n_lanes);
}

BENCHMARK_CAPTURE(BareLoop, Hopper, "Hopper-v5")->Arg(1)->Arg(16)->ArgName("lanes");
BENCHMARK_CAPTURE(OurStep, Hopper, "Hopper-v5")->Args({1, 1})->Args({16, 1})->ArgNames({"lanes", "threads"});
BENCHMARK_CAPTURE(BareLoop, HalfCheetah, "HalfCheetah-v5")->Arg(1)->Arg(16)->ArgName("lanes");
BENCHMARK_CAPTURE(OurStep, HalfCheetah, "HalfCheetah-v5")->Args({1, 1})->Args({16, 1})->ArgNames({"lanes", "threads"});
BENCHMARK_CAPTURE(BareLoop, Walker2d, "Walker2d-v5")->Arg(1)->Arg(16)->ArgName("lanes");
BENCHMARK_CAPTURE(OurStep, Walker2d, "Walker2d-v5")->Args({1, 1})->Args({16, 1})->ArgNames({"lanes", "threads"});

}  // namespace
}  // namespace oted
