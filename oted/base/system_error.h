#pragma once
/// What the system refuses, in our words.

#include <filesystem>

namespace oted {

/// What a user can do about a system call that failed with `error` (errno).
const char* RemedyOf(int error);

/// A system call on `path` failed with `error` (errno). The message holds the remedy.
/// @param what  the verb: "write"
/// @throws UsageError where the name is too long, else FileError
[[noreturn]] void ThrowSystemError(const char* what, const std::filesystem::path& path, int error);

}  // namespace oted
