#pragma once
/// Files appear whole or not at all.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace oted {

/// Writes `bytes` beside `path`, then renames: a reader sees the old file or the new one, never a part.
/// Creates missing parent folders. @throws DataError naming the path and the system's reason.
void WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes);

/// A path beside `path` to write to, and its move to `path` on Commit; removed when never committed. For libraries
/// that want to write a file themselves (HDF5).
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;
  const std::filesystem::path& temporary_path() const { return temporary_path_; }
  void Commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_path_;
};

/// The whole file. @throws DataError when it cannot be read.
std::string ReadFile(const std::filesystem::path& path);

/// Writes `value` with two spaces of indentation and a final newline, atomically.
void WriteJson(const std::filesystem::path& path, const nlohmann::json& value);
/// @throws DataError when the file cannot be read or is not JSON.
nlohmann::json ReadJson(const std::filesystem::path& path);

/// Lower-case hexadecimal SHA-256.
std::string Sha256(std::string_view bytes);
std::string Sha256OfFile(const std::filesystem::path& path);

}  // namespace oted
