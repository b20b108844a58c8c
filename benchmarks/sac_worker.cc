// Our side of sac_peers.py: SAC on one thread, a slice at a time.
//   sac_worker updates OBS_DIM ACT_DIM     whole updates on noise, drawing the batch included
//   sac_worker products OBS_DIM ACT_DIM    an update's matrix products by the linked BLAS
//   sac_worker training TASK FOLDER        TrainAgent, one update per environment step; a slice is 256 steps
//   sac_worker losses OBS_DIM ACT_DIM FOLDER STEPS  leaves start.npz, what the learner holds, and STEP.npz for each
//                                          update: its batch and its losses
// Of the others, a line "SECONDS" on stdin asks for a slice of that much CPU time; the answer is "COUNT CPU_SECONDS
// WALL_SECONDS".

#include <cstdlib>
#include <filesystem>
#include <functional>
#include <iostream>
#include <string>

#include "benchmarks/sac_workload.h"
#include "oted/data/npz.h"
#include "oted/rl/sac.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"

namespace oted {
namespace {

class Slice {
 public:
  double cpu() const { return Now(CLOCK_PROCESS_CPUTIME_ID) - cpu_; }
  void Answer(int64_t count) const {
    std::cout << count << " " << cpu() << " " << Now(CLOCK_MONOTONIC) - wall_ << std::endl;
  }

 private:
  double wall_ = Now(CLOCK_MONOTONIC), cpu_ = Now(CLOCK_PROCESS_CPUTIME_ID);
};

void Serve(const std::function<void()>& work) {
  for (int i = 0; i < 20; ++i) work();
  std::cout << "ready" << std::endl;
  double seconds;
  while (std::cin >> seconds) {
    const Slice slice;
    int64_t count = 0;
    for (; slice.cpu() < seconds; ++count) work();
    slice.Answer(count);
  }
}

// Training reports its progress every 256 updates: there a slice ends, and the next one waits to be asked for.
class SliceSink : public NullSink {
 public:
  void Progress(std::string_view, std::string_view, int64_t done, int64_t, std::string_view) override {
    if (begin_ > 0) {
      slice_.Answer(done - begin_);
    } else {
      std::cout << "ready" << std::endl;
    }
    double seconds;
    if (!(std::cin >> seconds)) std::exit(0);
    begin_ = done;
    slice_ = Slice();
  }

 private:
  int64_t begin_ = 0;
  Slice slice_;
};

void Train(const std::string& task, const std::string& folder) {
  const MujocoSimulatorFactory factory(task, {});
  SacConfig config;
  config.n_steps = config.eval_interval = 100'000'000;  // one segment, no evaluation
  // The settings of the packages beside it.
  config.n_lanes = config.multi_step = config.n_starts = 1;
  config.average_over = 1;
  config.batch_size = 256;
  config.hidden = {256, 256};
  config.learning_rate = 3e-4;
  config.normalize_observations = false;
  SliceSink sink;
  RunContext context;
  context.log = &sink;
  DrawnEpisodes source([](Rng&) { return std::vector<double>{}; });
  TrainAgent({.factory = factory,
              .source = source,
              .eval_parameters = {{}},
              .key = RngKey(1),
              .folder = folder,
              .run_name = "agent",
              .context = context},
             config);
}

void WriteLosses(int obs_dim, int act_dim, const std::filesystem::path& folder, int n_steps) {
  ReplayWorkload learner(ReplayWorkload::Algorithm::kSac, obs_dim, act_dim);
  NpzArrays start;
  learner.update().Save(start);
  WriteNpz(start, folder / "start.npz");
  for (int step = 0; step < n_steps; ++step) {
    learner.Step();
    const TransitionBatch& batch = learner.batch();
    const ReplayLosses& losses = learner.losses();
    NpzArrays arrays;
    const auto add = [&](const char* name, const AlignedVector<float>& values) {
      arrays[name] = NpyArray(std::vector<float>(values.begin(), values.end()));
    };
    add("observations", batch.observations);
    add("joint", batch.joint);
    add("rewards", batch.rewards);
    add("discounts", batch.discounts);
    add("noise", batch.noise);
    arrays["losses"] =
        NpyArray(std::vector<double>{losses.critic_loss, losses.actor_loss, losses.alpha, losses.alpha_loss});
    WriteNpz(arrays, folder / (std::to_string(step) + ".npz"));
  }
}

int Main(int argc, char** argv) {
  if (argc == 6 && std::string(argv[1]) == "losses") {
    WriteLosses(std::atoi(argv[2]), std::atoi(argv[3]), argv[4], std::atoi(argv[5]));
    return 0;
  }
  if (argc != 4) return 2;
  const std::string mode = argv[1];
  if (mode == "training") {
    Train(argv[2], argv[3]);
    return 0;
  }
  const int obs_dim = std::atoi(argv[2]), act_dim = std::atoi(argv[3]);
  if (mode == "updates") {
    ReplayWorkload learner(ReplayWorkload::Algorithm::kSac, obs_dim, act_dim);
    Serve([&] { learner.Step(); });
    return 0;
  }
  Products actor(BlasGemm, obs_dim, 2 * act_dim), critic(BlasGemm, obs_dim + act_dim, 1);
  Serve([&] { MultiplyAll(actor, critic, act_dim); });
  return 0;
}

}  // namespace
}  // namespace oted

int main(int argc, char** argv) { return oted::Main(argc, argv); }
