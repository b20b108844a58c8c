#pragma once
/// Which MuJoCo this is, without its headers.

#include <string>

namespace oted {

/// Of the library that is loaded: "4.0.0".
std::string MujocoVersion();

}  // namespace oted
