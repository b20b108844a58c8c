#pragma once
/// Which columns of a log are which numbers of a model, by their names.

#include <string>
#include <vector>

#include "oted/sim/mujoco/model_outline.h"

namespace oted {

struct ColumnMap {
  struct Entry {
    std::string column;
    std::string path;         ///< "joint/hip/qpos", "sensor/imu[2]", "actuator/hip"
    bool by_order = false;    ///< numbered columns, and the model's order: nothing in the name says that
    bool in_degrees = false;  ///< by its name
  };
  std::vector<Entry> observations;  ///< in the order of task.observations
  std::vector<Entry> actions;       ///< in the order of the actuators
  std::vector<std::string> motors;  ///< joints that need one: the model has no actuators
  std::string episode, time;        ///< columns, where no convention finds them
  std::vector<std::string> unused;  ///< "'name': why"
  bool IsEmpty() const { return observations.empty() && actions.empty(); }
};

/// Columns match an object by its name, by what is left of both names without words such as "joint", or by the only one
/// that is part of the other. Numbered ones ("q0", "obs_3") match by order where there are as many as the model has
/// numbers. Where two columns claim one number, the plainer name wins.
ColumnMap MapColumns(const std::vector<std::string>& columns, const ModelOutline& model);

}  // namespace oted
