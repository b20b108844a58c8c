#pragma once
/// One run directory, one program.

#include <filesystem>
#include <memory>

namespace oted {

/// Held from its making to its end by one program at a time; the system gives it back when a program dies. The file
/// `.lock` in the folder says who holds it, and is removed in the end.
class RunLock {
 public:
  /// @throws UsageError that names the process when another holds it; DataError when the folder takes no files
  explicit RunLock(const std::filesystem::path& folder);
  ~RunLock();
  RunLock(const RunLock&) = delete;
  RunLock& operator=(const RunLock&) = delete;

  /// @throws DataError when the folder is no longer where it was: moved, removed, or another in its place
  void CheckPlace() const;

 private:
  bool TryToLock();
  std::filesystem::path file_;
  int descriptor_ = -1;
};

/// Whether some program works in that run directory now.
bool IsLocked(const std::filesystem::path& folder);

}  // namespace oted
