// One SAC learner of RLtools as a worker of sac_peers.py, through its own training loop: one update per environment
// step. The environment is a stand-in of the task's dimensions that returns noise, so its step is next to nothing. Not
// part of the CMake build: sac_peers.py compiles it against PyPI's rltools (headers) and scipy-openblas32. A line
// "SECONDS" on stdin runs updates for that much CPU time and answers "COUNT CPU_SECONDS WALL_SECONDS".

#include <rl_tools/operations/cpu_mux.h>
// The order is RLtools': operations of the device before those of networks, those before the loop.
// clang-format off
#include <rl_tools/nn/optimizers/adam/instance/operations_generic.h>
#include <rl_tools/nn/operations_cpu_mux.h>
#include <rl_tools/nn/layers/sample_and_squash/operations_generic.h>
#include <rl_tools/nn_models/mlp/operations_generic.h>
#include <rl_tools/nn_models/sequential/operations_generic.h>
#include <rl_tools/nn/optimizers/adam/operations_generic.h>
#include <rl_tools/rl/environments/environments.h>
#include <rl_tools/rl/environments/operations_generic.h>
// clang-format on
#include <time.h>

#include <array>
#include <iostream>

namespace rlt = rl_tools;

using Device = rlt::devices::DEVICE_FACTORY<>;
using Engine = Device::SPEC::RANDOM::ENGINE<>;
using Index = Device::index_t;
using Policy = rlt::numeric_types::Policy<float>;

struct NoiseParameters {};
struct NoiseState {
  static constexpr Index DIM = OBS_DIM;
  std::array<float, OBS_DIM> values;
};
struct NoiseObservation {
  static constexpr Index DIM = OBS_DIM;
};
struct NoiseEnvironment : rlt::rl::environments::Environment<float, Index> {
  using T = float;
  using TI = Index;
  using Parameters = NoiseParameters;
  using State = NoiseState;
  using Observation = NoiseObservation;
  using ObservationPrivileged = NoiseObservation;
  static constexpr TI N_AGENTS = 1;
  static constexpr TI ACTION_DIM = ACT_DIM;
  static constexpr TI EPISODE_STEP_LIMIT = 1000;
};

namespace rl_tools {
template <class D>
void malloc(D&, const NoiseEnvironment&) {}
template <class D>
void free(D&, const NoiseEnvironment&) {}
template <class D>
void init(D&, const NoiseEnvironment&) {}
template <class D>
void initial_parameters(D&, const NoiseEnvironment&, NoiseParameters&) {}
template <class D, class R>
void sample_initial_parameters(D&, const NoiseEnvironment&, NoiseParameters&, R&) {}
template <class D>
void initial_state(D&, const NoiseEnvironment&, NoiseParameters&, NoiseState& state) {
  state.values.fill(0);
}
template <class D, class R>
void sample_initial_state(D& device, const NoiseEnvironment& env, NoiseParameters& parameters, NoiseState& state, R&) {
  initial_state(device, env, parameters, state);
}
template <class D, class A, class R>
float step(D&, const NoiseEnvironment&, NoiseParameters&, const NoiseState&, const Matrix<A>&, NoiseState& next,
           R& rng) {
  for (float& v : next.values) v = random::uniform_real_distribution(typename D::SPEC::RANDOM(), -1.0f, 1.0f, rng);
  return 1;
}
template <class D, class A, class R>
float reward(D&, const NoiseEnvironment&, NoiseParameters&, const NoiseState& state, const Matrix<A>&,
             const NoiseState&, R&) {
  return state.values[0];
}
template <class D, class O, class R>
void observe(D&, const NoiseEnvironment&, const NoiseParameters&, const NoiseState& state, const NoiseObservation&,
             Matrix<O>& out, R&) {
  for (Index i = 0; i < OBS_DIM; ++i) set(out, 0, i, state.values[i]);
}
template <class D, class R>
bool terminated(D&, const NoiseEnvironment&, NoiseParameters&, const NoiseState&, R&) {
  return false;
}
}  // namespace rl_tools

#include <rl_tools/rl/algorithms/sac/loop/core/config.h>
#include <rl_tools/rl/algorithms/sac/loop/core/operations_generic.h>

struct LoopParameters : rlt::rl::algorithms::sac::loop::core::DefaultParameters<Policy, Index, NoiseEnvironment> {
  struct SAC_PARAMETERS : rlt::rl::algorithms::sac::DefaultParameters<Policy, Index, ACT_DIM> {
    static constexpr Index ACTOR_BATCH_SIZE = 256;
    static constexpr Index CRITIC_BATCH_SIZE = 256;
  };
  static constexpr Index N_WARMUP_STEPS = 1000;
  static constexpr Index N_WARMUP_STEPS_CRITIC = 1000;
  static constexpr Index N_WARMUP_STEPS_ACTOR = 1000;
  static constexpr Index STEP_LIMIT = 100000000;
  static constexpr Index REPLAY_BUFFER_CAP = 10000;
  static constexpr Index ACTOR_HIDDEN_DIM = 256;
  static constexpr Index CRITIC_HIDDEN_DIM = 256;
  static constexpr bool COLLECT_EPISODE_STATS = false;
  struct Adam : rlt::nn::optimizers::adam::DEFAULT_PARAMETERS_TENSORFLOW<Policy> {
    static constexpr float ALPHA = 3e-4f;
  };
  using ACTOR_OPTIMIZER_PARAMETERS = Adam;
  using CRITIC_OPTIMIZER_PARAMETERS = Adam;
  using ALPHA_OPTIMIZER_PARAMETERS = Adam;
};

using Config = rlt::rl::algorithms::sac::loop::core::Config<Policy, Index, Engine, NoiseEnvironment, LoopParameters>;

double Now(clockid_t clock) {
  timespec time;
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

int main() {
  Device device;
  static Config::State<Config> state;
  rlt::init(device);
  rlt::malloc(device, state);
  rlt::init(device, state, 1);
  for (int i = 0; i < 1100; ++i) rlt::step(device, state);
  std::cout << "ready" << std::endl;
  double seconds;
  while (std::cin >> seconds) {
    const double wall = Now(CLOCK_MONOTONIC), cpu = Now(CLOCK_PROCESS_CPUTIME_ID);
    long count = 0;
    for (; Now(CLOCK_PROCESS_CPUTIME_ID) - cpu < seconds; ++count) rlt::step(device, state);
    std::cout << count << " " << Now(CLOCK_PROCESS_CPUTIME_ID) - cpu << " " << Now(CLOCK_MONOTONIC) - wall << std::endl;
  }
}
