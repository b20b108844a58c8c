#include "oted/base/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void ThrowSystemError(const char* what, const fs::path& path, int error) {
  throw DataError(fmt::format("cannot {} '{}': {}; choose another place or fix its permissions", what, path.string(),
                              std::strerror(error)));
}

void SyncToDisk(const fs::path& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return;
  ::fsync(fd);
  ::close(fd);
}

}  // namespace

AtomicFile::AtomicFile(fs::path path) : path_(std::move(path)) {
  static std::atomic<int> counter{0};
  std::error_code error;
  if (path_.has_parent_path()) fs::create_directories(path_.parent_path(), error);
  if (error) ThrowSystemError("create the folder", path_.parent_path(), error.value());
  temporary_path_ = path_;
  temporary_path_ += fmt::format(".tmp-{}-{}", ::getpid(), counter++);
}

AtomicFile::~AtomicFile() {
  std::error_code ignored;
  if (!temporary_path_.empty()) fs::remove(temporary_path_, ignored);
}

void AtomicFile::Commit() {
  SyncToDisk(temporary_path_);
  std::error_code error;
  fs::rename(temporary_path_, path_, error);
  if (error) ThrowSystemError("write", path_, error.value());
  temporary_path_.clear();
}

void WriteFileAtomically(const fs::path& path, std::string_view bytes) {
  AtomicFile file(path);
  {
    std::ofstream out(file.temporary_path(), std::ios::binary);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.flush();
    if (!out) ThrowSystemError("write", path, errno);
  }
  file.Commit();
}

std::string ReadFile(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) ThrowSystemError("read", path, errno);
  std::error_code error;
  if (fs::is_directory(path, error)) ThrowSystemError("read", path, EISDIR);
  std::string bytes(std::istreambuf_iterator<char>(in), {});
  if (in.bad()) ThrowSystemError("read", path, errno);
  return bytes;
}

void WriteJson(const fs::path& path, const nlohmann::json& value) { WriteFileAtomically(path, value.dump(2) + "\n"); }

nlohmann::json ReadJson(const fs::path& path) {
  try {
    return nlohmann::json::parse(ReadFile(path));
  } catch (const nlohmann::json::exception& e) {
    throw DataError(
        fmt::format("'{}' is not valid JSON ({}); remove it and run the command again", path.string(), e.what()));
  }
}

std::string Sha256(std::string_view bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  OTED_CHECK(EVP_Digest(bytes.data(), bytes.size(), digest.data(), &size, EVP_sha256(), nullptr) == 1);
  std::string hex;
  for (unsigned int i = 0; i < size; ++i) hex += fmt::format("{:02x}", digest[i]);
  return hex;
}

std::string Sha256OfFile(const fs::path& path) { return Sha256(ReadFile(path)); }

}  // namespace oted
