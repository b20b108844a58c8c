#include "oted/checks/engine_check.h"

#include <algorithm>

#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/mujoco/task.h"

namespace oted {
namespace {

constexpr double kRounding = 1e-4;  // of the change per step: what single precision and a velocity clip leave

}  // namespace

std::optional<EngineMatch> FindBetterEngine(const std::string& task, const OneStepError& here, const Dataset& dataset,
                                            int max_rows, int n_threads) {
  const std::vector<std::string> names = TaskNames();
  if (std::find(names.begin(), names.end(), task) == names.end() || here.median_ratio < kRounding) return std::nullopt;
  const std::string robot = task.substr(0, task.rfind("-v") + 2);
  EngineMatch best{task, here.median_ratio};
  for (const std::string& name : names) {
    if (name == task || !name.starts_with(robot)) continue;
    const double ratio = MeasureOneStep(MujocoSimulatorFactory(name, {}), dataset, max_rows, n_threads).median_ratio;
    if (ratio < best.ratio) best = {name, ratio};
  }
  if (best.ratio >= 0.5 * here.median_ratio) return std::nullopt;
  return best;
}

}  // namespace oted
