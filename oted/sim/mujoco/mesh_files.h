#pragma once
/// Files of meshes as ROS names them in URDF: `package://NAME/...` and `file:///...`.

#include <mujoco/mujoco.h>

#include <filesystem>

namespace oted {

/// Puts the files in place of such names. A package is the folder NAME among the folders above the model, beside one of
/// these, in a folder of ROS_PACKAGE_PATH, or in `share` of a folder of AMENT_PREFIX_PATH: the first that holds the
/// file.
/// @param model  the file that `spec` was read from
/// @throws DataError when none does, naming the folders that were looked into
void FindMeshFiles(mjSpec& spec, const std::filesystem::path& model);

}  // namespace oted
