#pragma once
/// Model files of strangers: whether MuJoCo reads one at all, found out where it can do no harm.

#include <filesystem>

namespace oted {

/// Parses and compiles the file in a child process within limits of memory and time, once per process and content.
/// @throws DataError naming the file where LoadModel would throw, and where MuJoCo crashes, hangs or asks for more than
/// a GiB
void ProbeModel(const std::filesystem::path& path);

}  // namespace oted
