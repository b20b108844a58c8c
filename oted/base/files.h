#pragma once
/// Files appear whole or not at all, and what has its final name is on the disk.

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>

#include "oted/base/error.h"

namespace oted {

/// The file system does not allow what was asked: the disk is full, fails, or is not for writing.
class FileError : public DataError {
 public:
  using DataError::DataError;
};

/// Writes `bytes` beside `path`, then renames: a reader sees the old file or the new one, never a part. When it
/// returns, the file and its name are on the disk. Creates missing parent folders.
/// @throws FileError naming the path and the system's reason; the old file is then untouched.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes);

/// While it lives, every AtomicFile below `folder` asks `check` first, which throws where the folder is not to be
/// written to any more: one that was moved away would be made anew.
class WriteGuard {
 public:
  WriteGuard(const std::filesystem::path& folder, std::function<void()> check);
  ~WriteGuard();
  WriteGuard(const WriteGuard&) = delete;
  WriteGuard& operator=(const WriteGuard&) = delete;

 private:
  uint64_t id_;
};

/// A path beside `path` to write to, and its move to `path` on Commit; removed when never committed. For libraries
/// that want to write a file or a folder themselves (HDF5, Minari).
class AtomicFile {
 public:
  /// Creates missing parent folders, and removes what writers of `path` that have died left beside it. Follows links.
  /// @throws UsageError where `path` is a device, a pipe or a stream (/dev/stdout)
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  const std::filesystem::path& temporary_path() const { return temporary_path_; }
  /// @throws DataError when it cannot be written
  void Write(std::string_view bytes);
  /// @throws DataError when it cannot be brought to the disk or renamed.
  void Commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_path_;
};

/// Removes the temporary files and folders in `folder`, and anywhere in its folders `below`, but those of programs that
/// are at work on this machine. For one who knows that no other machine writes there.
void RemoveTemporaries(const std::filesystem::path& folder, std::span<const char* const> below);
/// Whether that is the name of an AtomicFile's temporary.
bool IsTemporaryName(const std::string& name);

/// Creates a folder and its missing parents, and brings their names to the disk. @throws DataError
void MakeFolders(const std::filesystem::path& folder);
/// Removes a file where there is one. @throws DataError when it stays.
void RemoveFile(const std::filesystem::path& path);

/// Reads and writes at the end of one file, with every error checked.
class OpenFile {
 public:
  /// @param flags  of open(2); the file is closed in child processes. @throws DataError
  OpenFile(std::filesystem::path path, int flags);
  ~OpenFile();
  OpenFile(OpenFile&& other) noexcept;
  OpenFile& operator=(OpenFile&&) = delete;
  int descriptor() const { return descriptor_; }
  /// Writes all of it. @throws DataError
  void Write(std::string_view bytes);
  void WriteAt(uint64_t offset, std::string_view bytes);
  /// @throws DataError when the disk does not take it
  void Sync();
  void Truncate(uint64_t size);
  /// The file's bytes, from its beginning. @throws DataError when there are more than `most`
  std::string Read(uint64_t most = std::numeric_limits<uint64_t>::max());

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

/// @throws UsageError where `path` is there but neither a regular file nor a folder: a device or a pipe has no end
void CheckIsFile(const std::filesystem::path& path);

/// The whole file. @throws DataError when it cannot be read or has more than `most` bytes, UsageError when it is a
/// device or a pipe.
std::string ReadFile(const std::filesystem::path& path, uint64_t most = std::numeric_limits<uint64_t>::max());

/// `value` with two spaces of indentation and a final newline. What is no UTF-8 in it is replaced.
std::string JsonText(const nlohmann::json& value);
/// Writes JsonText atomically.
void WriteJson(const std::filesystem::path& path, const nlohmann::json& value);
/// The text of what should be JSON. @throws DataError when the file cannot be read or has more than 64 MiB
std::string ReadJsonText(const std::filesystem::path& path);
/// @throws DataError as ReadJsonText, and when it is not JSON or is nested more than 64 deep.
nlohmann::json ReadJson(const std::filesystem::path& path);
/// The same of a text. @param where  what it is, for errors
nlohmann::json ParseJson(std::string_view text, const std::string& where);

/// Lower-case hexadecimal SHA-256.
std::string Sha256(std::string_view bytes);
std::string Sha256OfFile(const std::filesystem::path& path);

}  // namespace oted
