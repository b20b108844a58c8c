#include "oted/sim/mujoco/model_probe.h"

#include <mutex>
#include <set>
#include <tuple>

#include "oted/base/files.h"
#include "oted/data/child_process.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/mujoco_errors.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

constexpr ChildLimits kLimits = {.memory_bytes = uint64_t{3} << 29, .cpu_s = 120, .wall_s = 240};

}  // namespace

void ProbeModel(const fs::path& path) {
  static std::mutex mutex, mujoco_lock;
  static std::set<std::tuple<fs::path, fs::file_time_type, uintmax_t>> known;
  CheckIsFile(path);
  std::error_code error;
  const std::tuple file(path, fs::last_write_time(path, error), fs::file_size(path, error));
  const std::lock_guard lock(mutex);
  if (known.contains(file)) return;
  TakeOverMujocoErrors();
  ChildProcess child(path.string(), kLimits, mujoco_lock, [&](ChildOutput& out) {
    // What fails here, fails for good: without the limits it might go on to take all memory.
    const LoadedModel loaded = LoadModel(path);
    const DataPtr data(mj_makeData(loaded.model.get()));
    const char done = 1;
    out.Write(&done, 1);
  });
  char done = 0;
  child.Read(&done, 1);
  known.insert(file);
}

}  // namespace oted
