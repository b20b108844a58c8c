#include "oted/base/files.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/evp.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/process.h"
#include "oted/base/system_error.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr std::string_view kTemporary = ".oted-tmp-";
constexpr size_t kTagLength = 8;
constexpr size_t kBlock = size_t{1} << 20;
constexpr uint64_t kMostJsonBytes = uint64_t{1} << 26;
constexpr int kDeepestJson = 64;

/// Some file systems know no sync of a folder.
bool CannotSyncFolders(int error) { return error == EINVAL || error == ENOTSUP || error == EROFS || error == EACCES; }

void SyncFolder(const fs::path& folder) {
  const fs::path place = folder.empty() ? fs::path(".") : folder;
  const int fd = ::open(place.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const int result = fd < 0 ? -1 : ::fsync(fd), error = errno;
  if (fd >= 0) ::close(fd);
  if (result != 0 && !CannotSyncFolders(error)) ThrowSystemError("bring to the disk", place, error);
}

/// A file, or a folder with all that is in it.
void SyncAll(const fs::path& path) {
  if (!fs::is_directory(path)) return OpenFile(path, O_RDONLY).Sync();
  for (const auto& entry : fs::directory_iterator(path)) SyncAll(entry.path());
  SyncFolder(path);
}

/// Of the processes that share process numbers with this one: the machine since it was started, and its container.
const std::string& MachineTag() {
  static const std::string tag = [] {
    std::array<char, 256> text{};
    std::string machine;
    const int fd = ::open("/proc/sys/kernel/random/boot_id", O_RDONLY | O_CLOEXEC);
    if (fd >= 0) {
      const ssize_t n = ::read(fd, text.data(), text.size());
      if (n > 0) machine.assign(text.data(), static_cast<size_t>(n));
      ::close(fd);
    }
    const ssize_t n = ::readlink("/proc/self/ns/pid", text.data(), text.size());
    if (n > 0) machine.append(text.data(), static_cast<size_t>(n));
    return Sha256(machine).substr(0, kTagLength);
  }();
  return tag;
}

/// Of this process; of a child of its own, where it forked.
uint64_t OwnStart() {
  static std::atomic<int> pid{0};
  static std::atomic<uint64_t> start{0};
  if (const int now = ::getpid(); pid != now) {
    start = ProcessStart(now).value_or(0);
    pid = now;
  }
  return start;
}

/// Whose temporary it is.
struct Maker {
  std::string_view machine;
  int pid = 0;
  uint64_t started = 0;  ///< ProcessStart

  bool IsHere() const { return machine == MachineTag(); }
  bool IsDead() const {
    if (::kill(pid, 0) != 0 && errno == ESRCH) return true;
    const std::optional<uint64_t> start = ProcessStart(pid);
    return start && *start != started;  // its number was given again, or nobody has buried it yet
  }
};

/// Reads "-" and a number behind `text`, and takes both away. @return whether they were there
template <class Number>
bool TakeNumber(std::string_view& text, Number& number) {
  if (!text.starts_with('-')) return false;
  const auto [behind, error] = std::from_chars(text.data() + 1, text.data() + text.size(), number);
  text.remove_prefix(static_cast<size_t>(behind - text.data()));
  return error == std::errc{};
}

/// By the name of a temporary: FILE.oted-tmp-MACHINE-PID-START-NUMBER; nothing for any other name.
std::optional<Maker> MakerOf(std::string_view name) {
  const size_t at = name.rfind(kTemporary);
  if (at == std::string_view::npos || at == 0) return std::nullopt;
  std::string_view rest = name.substr(at + kTemporary.size());
  Maker maker{rest.substr(0, kTagLength)};
  if (maker.machine.size() < kTagLength) return std::nullopt;
  if (maker.machine.find_first_not_of("0123456789abcdef") != std::string_view::npos) return std::nullopt;
  rest.remove_prefix(kTagLength);
  unsigned number = 0;
  const bool has_all = TakeNumber(rest, maker.pid) && TakeNumber(rest, maker.started) && TakeNumber(rest, number);
  if (!has_all || !rest.empty() || maker.pid <= 0) return std::nullopt;
  return maker;
}

/// Once per process and file: what a dead writer left will not become more.
void RemoveDeadTemporaries(const fs::path& path) {
  static std::mutex mutex;
  static std::set<fs::path> done;
  {
    const std::lock_guard lock(mutex);
    if (!done.insert(path).second) return;
  }
  const std::string begin = path.filename().string() + std::string(kTemporary);
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    const auto maker = name.starts_with(begin) ? MakerOf(name) : std::nullopt;
    if (maker && maker->IsHere() && maker->IsDead()) fs::remove_all(entry.path(), ignored);
  }
}

class Digest {
 public:
  Digest() : context_(EVP_MD_CTX_new(), EVP_MD_CTX_free) {
    OTED_CHECK(context_ != nullptr && EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) == 1);
  }
  void Add(const void* bytes, size_t size) { OTED_CHECK(EVP_DigestUpdate(context_.get(), bytes, size) == 1); }
  std::string Hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int size = 0;
    OTED_CHECK(EVP_DigestFinal_ex(context_.get(), digest.data(), &size) == 1);
    std::string hex;
    for (unsigned int i = 0; i < size; ++i) hex += fmt::format("{:02x}", digest[i]);
    return hex;
  }

 private:
  std::unique_ptr<EVP_MD_CTX, void (*)(EVP_MD_CTX*)> context_;
};

}  // namespace

OpenFile::OpenFile(fs::path path, int flags) : path_(std::move(path)) {
  // A pipe without a writer would be waited for.
  descriptor_ = ::open(path_.c_str(), flags | O_CLOEXEC | O_NONBLOCK, 0666);
  const bool reads = (flags & O_ACCMODE) == O_RDONLY;
  if (descriptor_ < 0) ThrowSystemError(reads ? "read" : "write", path_, errno);
  struct stat status {};
  if (::fstat(descriptor_, &status) == 0 && S_ISDIR(status.st_mode)) {
    ::close(descriptor_);
    ThrowSystemError(reads ? "read" : "write", path_, EISDIR);
  }
}

OpenFile::~OpenFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

OpenFile::OpenFile(OpenFile&& other) noexcept : path_(std::move(other.path_)), descriptor_(other.descriptor_) {
  other.descriptor_ = -1;
}

void OpenFile::Write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(descriptor_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) ThrowSystemError("write", path_, n < 0 ? errno : ENOSPC);
    bytes.remove_prefix(static_cast<size_t>(n));
  }
}

void OpenFile::WriteAt(uint64_t offset, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) ThrowSystemError("write", path_, n < 0 ? errno : ENOSPC);
    bytes.remove_prefix(static_cast<size_t>(n));
    offset += static_cast<uint64_t>(n);
  }
}

void OpenFile::Sync() {
  while (::fsync(descriptor_) != 0) {
    if (errno != EINTR) ThrowSystemError("bring to the disk", path_, errno);
  }
}

void OpenFile::Truncate(uint64_t size) {
  if (::ftruncate(descriptor_, static_cast<off_t>(size)) != 0) ThrowSystemError("write", path_, errno);
}

std::string OpenFile::Read(uint64_t most) {
  struct stat status {};
  uint64_t expected = 0;
  if (::fstat(descriptor_, &status) == 0 && status.st_size > 0) expected = static_cast<uint64_t>(status.st_size);
  const auto too_large = [&] {
    return DataError(fmt::format("'{}' has more than {} MiB, more than such a file can have; is it the right one?",
                                 path_.string(), most >> 20));
  };
  if (expected > most) throw too_large();
  std::string bytes;
  try {
    bytes.resize(expected + 1);      // one more, to see its end
  } catch (const std::exception&) {  // bad_alloc, or longer than a string may be
    throw DataError(fmt::format("'{}' has {} MiB, more than there is memory for; is it the right file?", path_.string(),
                                expected >> 20));
  }
  size_t size = 0;
  for (;;) {
    if (size == bytes.size()) bytes.resize(size + std::max(kBlock, size / 2));
    const ssize_t n = ::pread(descriptor_, bytes.data() + size, bytes.size() - size, static_cast<off_t>(size));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) ThrowSystemError("read", path_, errno);
    size += static_cast<size_t>(n);
    if (size > most) throw too_large();
    if (n == 0) break;
  }
  bytes.resize(size);
  return bytes;
}

namespace {

constexpr int kMostLinks = 40;  // as Linux follows

/// What a link leads to, as a shell's > has it.
fs::path BehindLinks(fs::path path) {
  std::error_code error;
  for (int hop = 0; hop < kMostLinks && fs::is_symlink(path, error); ++hop) {
    path = path.parent_path() / fs::read_symlink(path, error);
  }
  return path;
}

/// /dev/stdout leads to a file where one is behind it, but no name of that file is to get another content.
bool IsStream(const fs::path& path) {
  std::error_code error;
  const auto in = [&](const fs::path& place, const char* folder) {
    return fs::absolute(place, error).lexically_normal().string().starts_with(folder);
  };
  // /dev/shm holds plain files.
  const auto in_dev = [&](const fs::path& place) { return in(place, "/dev/") && !in(place, "/dev/shm/"); };
  if (!fs::is_symlink(path, error)) return false;
  const fs::path next = path.parent_path() / fs::read_symlink(path, error);
  return in_dev(path) || in_dev(next) || in(next, "/proc/");
}

}  // namespace

namespace {

struct Guard {
  fs::path folder;
  std::function<void()> check;
};

struct Guards {
  std::mutex mutex;
  std::map<uint64_t, Guard> by_id;
  uint64_t next = 0;

  static Guards& All() {
    static Guards guards;
    return guards;
  }
  void Check(const fs::path& path) {
    const std::lock_guard lock(mutex);
    for (const auto& [id, guard] : by_id) {
      const auto [in_folder, unused] = std::ranges::mismatch(guard.folder, path);
      if (in_folder == guard.folder.end()) guard.check();
    }
  }
};

}  // namespace

WriteGuard::WriteGuard(const fs::path& folder, std::function<void()> check) {
  Guards& guards = Guards::All();
  const std::lock_guard lock(guards.mutex);
  id_ = guards.next++;
  const bool ends_with_slash = folder.has_parent_path() && !folder.has_filename();
  guards.by_id[id_] = {ends_with_slash ? folder.parent_path() : folder, std::move(check)};
}

WriteGuard::~WriteGuard() {
  const std::lock_guard lock(Guards::All().mutex);
  Guards::All().by_id.erase(id_);
}

AtomicFile::AtomicFile(fs::path path) : path_(BehindLinks(path)) {
  static std::atomic<int> counter{0};
  std::error_code error;
  const fs::file_status found = fs::status(path_, error);
  if (IsStream(path) || (fs::exists(found) && !fs::is_regular_file(found) && !fs::is_directory(found))) {
    // A rename would put a file in its place.
    throw UsageError(
        fmt::format("'{}' is no regular file but a device, pipe or socket; name a file to write", path.string()));
  }
  Guards::All().Check(path);
  if (path_.has_parent_path()) MakeFolders(path_.parent_path());
  RemoveDeadTemporaries(path_);
  temporary_path_ = path_;
  temporary_path_ += fmt::format("{}{}-{}-{}-{}", kTemporary, MachineTag(), ::getpid(), OwnStart(), counter++);
}

AtomicFile::~AtomicFile() {
  std::error_code ignored;
  if (!temporary_path_.empty()) fs::remove(temporary_path_, ignored);
}

void AtomicFile::Commit() {
  SyncAll(temporary_path_);
  if (std::rename(temporary_path_.c_str(), path_.c_str()) != 0) ThrowSystemError("write", path_, errno);
  temporary_path_.clear();
  SyncFolder(path_.parent_path());
}

void AtomicFile::Write(std::string_view bytes) { OpenFile(temporary_path_, O_WRONLY | O_CREAT | O_TRUNC).Write(bytes); }

void WriteFileAtomically(const fs::path& path, std::string_view bytes) {
  AtomicFile file(path);
  file.Write(bytes);
  file.Commit();
}

bool IsTemporaryName(const std::string& name) { return MakerOf(name).has_value(); }

void RemoveTemporaries(const fs::path& folder, std::span<const char* const> below) {
  std::error_code ignored;
  std::vector<fs::path> found;
  const auto look = [&](const fs::path& path) {
    const std::string name = path.filename().string();
    const auto maker = MakerOf(name);
    // Of another machine, or of this one before it was started again, nobody can be alive who may write here.
    if (maker && !(maker->IsHere() && !maker->IsDead())) found.push_back(path);
  };
  for (const auto& entry : fs::directory_iterator(folder, ignored)) look(entry.path());
  for (const char* name : below) {
    fs::recursive_directory_iterator entry(folder / name, ignored);
    for (const fs::recursive_directory_iterator end; entry != end; entry.increment(ignored)) look(entry->path());
  }
  for (const fs::path& path : found) fs::remove_all(path, ignored);
}

void MakeFolders(const fs::path& folder) {
  std::error_code error;
  if (folder.empty() || fs::is_directory(folder, error)) return;
  if (folder.has_parent_path() && folder.parent_path() != folder) MakeFolders(folder.parent_path());
  // "a/" has an empty name: its parent is the folder itself.
  if (!folder.has_filename()) return;
  if (::mkdir(folder.c_str(), 0777) == 0) return SyncFolder(folder.parent_path());
  const int reason = errno;
  if (reason != EEXIST || !fs::is_directory(folder, error)) ThrowSystemError("create the folder", folder, reason);
}

void RemoveFile(const fs::path& path) {
  if (::unlink(path.c_str()) != 0 && errno != ENOENT) ThrowSystemError("remove", path, errno);
}

void CheckIsFile(const fs::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || S_ISREG(status.st_mode) || S_ISDIR(status.st_mode)) return;
  throw UsageError(
      fmt::format("'{}' is no regular file but a device, pipe or socket; name a file that has an end", path.string()));
}

std::string ReadFile(const fs::path& path, uint64_t most) {
  CheckIsFile(path);
  return OpenFile(path, O_RDONLY).Read(most);
}

std::string JsonText(const json& value) { return value.dump(2, ' ', false, json::error_handler_t::replace) + "\n"; }

void WriteJson(const fs::path& path, const json& value) { WriteFileAtomically(path, JsonText(value)); }

json ParseJson(std::string_view text, const std::string& where) {
  const auto fail = [&](const std::string& why) {
    return DataError(fmt::format(
        "'{}' is not valid JSON ({}); restore it, or remove it and run again the command that made it", where, why));
  };
  // Counted first: what is nested deeper than a record can be would overflow the stack of whoever walks it.
  int depth = 0;
  bool in_text = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_text) {
      if (c == '\\') ++i;
      in_text = c != '"';
    } else if (c == '"') {
      in_text = true;
    } else if (c == '[' || c == '{') {
      if (++depth > kDeepestJson) throw fail(fmt::format("nested more than {} deep", kDeepestJson));
    } else if (c == ']' || c == '}') {
      --depth;
    }
  }
  try {
    return json::parse(text);
  } catch (const json::exception& e) {
    const std::string_view why = e.what();  // "[json.exception.parse_error.101] parse error at line 1, ..."
    const size_t name = why.find("] ");
    throw fail(std::string(name == std::string_view::npos ? why : why.substr(name + 2)));
  }
}

std::string ReadJsonText(const fs::path& path) { return ReadFile(path, kMostJsonBytes); }

json ReadJson(const fs::path& path) { return ParseJson(ReadJsonText(path), path.string()); }

std::string Sha256(std::string_view bytes) {
  Digest digest;
  digest.Add(bytes.data(), bytes.size());
  return digest.Hex();
}

std::string Sha256OfFile(const fs::path& path) {
  CheckIsFile(path);
  const OpenFile file(path, O_RDONLY);
  Digest digest;
  std::string block(kBlock, '\0');
  for (;;) {
    const ssize_t n = ::read(file.descriptor(), block.data(), block.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) ThrowSystemError("read", path, errno);
    if (n == 0) return digest.Hex();
    digest.Add(block.data(), static_cast<size_t>(n));
  }
}

}  // namespace oted
