#include "oted/sim/mujoco/task.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdlib>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/base/package_folders.h"

namespace oted {
namespace {

MujocoTask Hopper(int version) {
  return {.name = fmt::format("Hopper-v{}", version),
          .xml_file = "hopper.xml",
          .frame_skip = 4,
          .legacy_capsules = version == 2,
          .velocity_clip = 10,
          .healthy_reward = 1,
          .healthy_on_terminal = version < 5,
          .control_cost_weight = 1e-3,
          .terminates = true,
          .healthy_height = {.low = 0.7},
          .healthy_angle = {.low = -0.2, .high = 0.2},
          .healthy_remainder = {.low = -100, .high = 100},
          .reset_noise = ResetNoise::kUniform,
          .reset_noise_scale = 5e-3,
          .return_random = -20.272305,
          .return_expert = 3234.3};
}

MujocoTask HalfCheetah(int version) {
  return {.name = fmt::format("HalfCheetah-v{}", version),
          .xml_file = "half_cheetah.xml",
          .frame_skip = 5,
          .legacy_capsules = version == 2,
          .control_cost_weight = 0.1,
          .healthy_height = {},
          .healthy_angle = {},
          .healthy_remainder = {},
          .reset_noise = ResetNoise::kUniformPositionsNormal,
          .reset_noise_scale = 0.1,
          .return_random = -280.178953,
          .return_expert = 12135.0};
}

// v5 differs in the model too: it gives the right foot the left one's friction.
MujocoTask Walker2d(int version) {
  return {.name = fmt::format("Walker2d-v{}", version),
          .xml_file = version < 5 ? "walker2d.xml" : "walker2d_v5.xml",
          .frame_skip = 4,
          .legacy_capsules = version == 2,
          .velocity_clip = 10,
          .healthy_reward = 1,
          .healthy_on_terminal = version < 5,
          .control_cost_weight = 1e-3,
          .terminates = true,
          .healthy_height = {.low = 0.8, .high = 2.0},
          .healthy_angle = {.low = -1, .high = 1},
          .healthy_remainder = {},
          .reset_noise = ResetNoise::kUniform,
          .reset_noise_scale = 5e-3,
          .return_random = 1.629008,
          .return_expert = 4592.3};
}

const std::vector<MujocoTask>& Tasks() {
  static const std::vector<MujocoTask> tasks = {Hopper(2),      Hopper(4),      Hopper(5),
                                                HalfCheetah(2), HalfCheetah(4), HalfCheetah(5),
                                                Walker2d(2),    Walker2d(4),    Walker2d(5)};
  return tasks;
}

}  // namespace

const MujocoTask& FindTask(const std::string& name) {
  for (const MujocoTask& task : Tasks()) {
    if (task.name == name) return task;
  }
  const std::vector<std::string> names = TaskNames();
  throw UsageError(fmt::format(
      "unknown task '{}'{}; there are {}, MiniGrid worlds (MiniGrid-...), and task files of own robots (NAME.toml)",
      name, DidYouMean(name, names), fmt::join(names, ", ")));
}

std::vector<std::string> TaskNames() {
  std::vector<std::string> names;
  for (const MujocoTask& task : Tasks()) names.push_back(task.name);
  return names;
}

std::filesystem::path AssetFolder() {
  const char* folder = std::getenv("OTED_ASSETS");
  return folder != nullptr && *folder != '\0' ? folder : FoundPackages().gymnasium_assets;
}

}  // namespace oted
