#pragma once
/// Which model it is.

#include <string>

#include "oted/sim/mujoco/model.h"

namespace oted {

/// SHA-256 of a compiled model: of its .mjb file. Where meshes, height fields, skins or textures come from files, it is
/// of all that the .mjb has but the paths of these: the same model may lie elsewhere or be named in another way.
std::string ModelSha256(const mjModel& model);

}  // namespace oted
