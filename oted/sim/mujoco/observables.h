#pragma once
/// What can be seen of a model, by path: "joint/*/qpos", "site/ee/xpos[2]", "sensor/imu". The grammar is that of the
/// parameters (object_path.h); docs/task_files.md lists owners, fields and units.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

namespace oted {

/// The part of a simulator's state that a number is of.
enum class StatePart { kNone, kQpos, kQvel, kAct };

/// One number that MuJoCo computes or stores.
struct Observable {
  std::string name;          ///< "joint/hip/qpos"; with "[i]" where the object has several numbers
  std::string array;         ///< "qpos", "qvel", "act", or mjData's field: "site_xpos", "sensordata", ...
  int index = 0;             ///< into that array
  int stage = mjSTAGE_NONE;  ///< mjtStage that MuJoCo must have computed
  StatePart part = StatePart::kNone;
};

/// Every number that `path` names, objects in the model's order, at least one.
/// @param what begins every error: "task.observations 'joint/*/qpo'"
/// @throws UsageError saying which part matches nothing, with the nearest name and the list.
std::vector<Observable> ResolveObservable(const mjModel& model, const std::string& path, const std::string& what);

/// The same number as an entry of qpos or qvel where it is one: a position or velocity sensor without cutoff or delay
/// shows its joint's. Otherwise the observable itself.
Observable AsState(const mjModel& model, const Observable& observable);

}  // namespace oted
