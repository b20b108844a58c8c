#pragma once
/// What the tests of whole runs share: a tiny study of Hopper, one run of it to compare with, and a sink that stops
/// runs.

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/collect/demonstrations.h"
#include "oted/data/dataset_files.h"
#include "oted/nn/policy.h"
#include "oted/run/pipeline.h"
#include "oted/run/run_inputs.h"

namespace oted {

/// Counts units of work, and may ask for a stop at one of them.
class Watch : public NullSink {
 public:
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t, std::string_view) override {
    const std::lock_guard lock(mutex);
    worked.insert(std::string(label));
    if (stage == stop_stage && done >= stop_at) stop = true;
  }
  void Warning(std::string_view message) override {
    const std::lock_guard lock(mutex);
    warnings.push_back(std::string(message));
  }
  std::mutex mutex;
  std::set<std::string> worked;
  std::vector<std::string> warnings;
  std::string stop_stage;
  int64_t stop_at = 0;
  std::atomic<bool> stop{false};
};

/// Eight episodes of random actions in Hopper-v5, written once.
inline const std::string& Demos() {
  static const TestFolder folder;
  static const std::string path = [] {
    const auto factory = MakeSimulatorFactory(TaskConfig::FromArgument("Hopper-v5"), {});
    const SimulatorSpec& spec = factory->spec();
    const size_t n = static_cast<size_t>(spec.obs_dim());
    TanhGaussianPolicy policy(Normalizer{std::vector<double>(n, 0), std::vector<double>(n, 1)}, {}, spec.action_low,
                              spec.action_high);
    std::fill(policy.net().parameters().begin(), policy.net().parameters().end(), 0.0f);
    const Dataset dataset = CollectDemonstrations(*factory, {}, policy, 8, RngKey(3), 1);
    WriteDataset(dataset, folder / "demos.hdf5");
    return folder / "demos.hdf5";
  }();
  return path;
}

inline RunConfig TinyConfig() {
  RunConfig config = RunConfig::FromToml(R"(
    [task]
    name = "Hopper-v5"
    [parameters]
    gravity  = { field = "opt/gravity[2]", range = [0.2, 2.0] }
    friction = { field = "geom/*/friction[0]", range = [0.2, 2.0] }
    [run]
    threads = 1
    [report]
    motion = false
    [clone]
    hidden = [16]
    max_steps = 60
    check_interval = 20
    [design.adversarial]
    n_iterations = 3
    n_sims = 4
    n_steps = 20
    [design.discriminator]
    hidden = [16]
    steps = 5
    batch = 32
    [design.trajectories]
    rows = 32
    window = 4
    starts = 1
    coarse = 4
    [selection]
    n_seeds = 2
    n_sims = 2
    n_steps = 20
    judge_steps = 20
    [agents]
    n_agents = 2
    selection_episodes = 2
    target_episodes = 2
    [sac]
    n_steps = 300
    learning_starts = 100
    batch_size = 32
    hidden = [16]
    buffer_size = 1000
    eval_interval = 150
    eval_episodes = 1
    [f_brc]
    behavior_steps = 100
    check_interval = 20
    n_steps = 150
    batch_size = 32
    hidden = [16]
    behavior_hidden = [16]
    [mbop]
    n_steps = 150
    batch_size = 32
    members = 2
    hidden = [16]
    horizon = 3
    trajectories = 10
    [td3_bc]
    n_steps = 150
    batch_size = 32
    hidden = [16]
    [rebrac]
    n_steps = 150
    batch_size = 32
    hidden = [16]
    [truth]
    gravity = 1.2
    friction = 0.6
  )",
                                         "tiny.toml");
  config.data.path = Demos();
  return config;
}

inline void RunPipeline(const RunConfig& config, const std::filesystem::path& out, Watch& watch,
                        const std::function<void(Pipeline&)>& call = &Pipeline::Run) {
  Pipeline pipeline(config, out, {.log = &watch, .stop = &watch.stop, .n_threads = 1});
  call(pipeline);
}
inline void RunPipeline(const RunConfig& config, const std::filesystem::path& out,
                        const std::function<void(Pipeline&)>& call = &Pipeline::Run) {
  Watch watch;
  RunPipeline(config, out, watch, call);
}

using Snapshot = std::map<std::string, std::pair<std::string, std::filesystem::file_time_type>>;
/// Every file below `root` with its bytes and the time of its last change.
inline Snapshot Look(const std::filesystem::path& root) {
  Snapshot files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
    if (!entry.is_regular_file()) continue;
    files[std::filesystem::relative(entry.path(), root).string()] = {ReadFile(entry.path()), entry.last_write_time()};
  }
  return files;
}
inline std::map<std::string, std::string> Bytes(const std::filesystem::path& root) {
  std::map<std::string, std::string> bytes;
  for (const auto& [name, file] : Look(root)) bytes[name] = file.first;
  return bytes;
}

/// One whole run that the tests compare with, and copies of it.
class PipelineTest : public testing::Test {
 protected:
  static const std::filesystem::path& Whole() {
    static const TestFolder folder;
    static const bool done = (RunPipeline(TinyConfig(), folder.path() / "run"), true);
    static const std::filesystem::path path = folder.path() / "run";
    EXPECT_TRUE(done);
    return path;
  }
  std::filesystem::path Copy() {
    std::filesystem::copy(Whole(), folder_.path() / "copy", std::filesystem::copy_options::recursive);
    return folder_.path() / "copy";
  }
  std::filesystem::path Fresh(const std::string& name) const { return folder_.path() / name; }
  /// The whole run up to its design.
  std::filesystem::path CopyWithoutAgents(const std::string& name) const {
    std::filesystem::copy(Whole(), Fresh(name), std::filesystem::copy_options::recursive);
    for (const char* made : {"agents", "nominal", "policy_selection.json", "evaluation.json", "policy.onnx"}) {
      std::filesystem::remove_all(Fresh(name) / made);
    }
    return Fresh(name);
  }

 private:
  TestFolder folder_;
};

}  // namespace oted
