#pragma once
/// What a policy's file says of the task that it was made for.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/sim/simulator.h"

namespace oted {

/// A sentence for each thing that differs between the task of a policy's file and `spec`, where the dimensions fit and
/// actions may mean something else all the same: names of observations and actions, the control period (of an ONNX
/// file with PolicyMetadata), the range of actions (of those and of our .npz). What a file does not say is no
/// difference.
/// @throws DataError: unreadable
std::vector<std::string> OtherThanItsTask(const std::filesystem::path& path, const SimulatorSpec& spec);

}  // namespace oted
