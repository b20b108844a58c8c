#pragma once
/// What the system refuses, in our words.

#include <filesystem>

namespace oted {

/// A system call on `path` failed with `error` (errno). The message holds the remedy.
/// @param what  the verb: "write"
/// @throws UsageError where the name is too long, else FileError
[[noreturn]] void ThrowSystemError(const char* what, const std::filesystem::path& path, int error);

}  // namespace oted
