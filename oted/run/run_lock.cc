#include "oted/run/run_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>

#include "oted/base/error.h"
#include "oted/base/system_error.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

constexpr const char* kName = ".lock";

/// "process 1234 on host": what a holder writes into the file.
std::string Myself() {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) host[0] = '\0';
  return fmt::format("process {} on {}", ::getpid(), host[0] == '\0' ? "this machine" : host.data());
}

std::string Content(int descriptor) {
  std::array<char, 512> text{};
  const ssize_t n = ::pread(descriptor, text.data(), text.size() - 1, 0);
  return n > 0 ? std::string(text.data(), static_cast<size_t>(n)) : "another process";
}

bool SameFile(int descriptor, const fs::path& file) {
  struct stat mine {
  }, named{};
  return ::fstat(descriptor, &mine) == 0 && ::stat(file.c_str(), &named) == 0 && mine.st_ino == named.st_ino &&
         mine.st_dev == named.st_dev;
}

/// Writes all of it from the file's beginning. @return 0, or the error
int Fill(int descriptor, const std::string& text) {
  if (::ftruncate(descriptor, 0) != 0) return errno;
  for (size_t done = 0; done < text.size();) {
    const ssize_t n = ::pwrite(descriptor, text.data() + done, text.size() - done, static_cast<off_t>(done));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return n < 0 ? errno : ENOSPC;
    done += static_cast<size_t>(n);
  }
  return 0;
}

/// One who only looks (IsLocked) is gone at once.
bool LockWithPatience(int descriptor) {
  for (int n_left = 5;; --n_left) {
    if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return true;
    if (errno != EWOULDBLOCK || n_left == 0) return false;
    ::poll(nullptr, 0, 20);
  }
}

}  // namespace

RunLock::RunLock(const fs::path& folder) : file_(folder / kName) {
  while (!TryToLock()) {
  }
}

/// False when the file that was locked had just been removed by the holder before.
bool RunLock::TryToLock() {
  const auto fail = [&](const char* what, int error) {
    if (descriptor_ >= 0) ::close(descriptor_);
    ThrowSystemError(what, file_, error);
  };
  // What a link leads to is not ours to write into.
  descriptor_ = ::open(file_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
  if (descriptor_ < 0) fail("write", errno);
  if (!LockWithPatience(descriptor_)) {
    const int error = errno;
    // A file system without locks is worked in without one.
    if (error == ENOLCK || error == ENOTSUP || error == ENOSYS) return true;
    if (error != EWOULDBLOCK) fail("lock", error);
    const std::string holder = Content(descriptor_);
    ::close(descriptor_);
    throw UsageError(fmt::format("{} works in '{}' already; wait for its end, stop it, or choose another --out", holder,
                                 file_.parent_path().string()));
  }
  if (!SameFile(descriptor_, file_)) {
    ::close(descriptor_);
    descriptor_ = -1;
    return false;
  }
  if (const int error = Fill(descriptor_, Myself())) {
    ::unlink(file_.c_str());
    fail("write", error);
  }
  return true;
}

void RunLock::CheckPlace() const {
  if (descriptor_ < 0 || SameFile(descriptor_, file_)) return;
  throw DataError(
      fmt::format("'{}' was moved or removed while this program worked in it (its {} is another or gone); move it back "
                  "if you can, and run the same command again",
                  file_.parent_path().string(), kName));
}

RunLock::~RunLock() {
  if (descriptor_ < 0) return;
  if (SameFile(descriptor_, file_)) ::unlink(file_.c_str());
  ::close(descriptor_);
}

bool IsLocked(const fs::path& folder) {
  const int descriptor = ::open((folder / kName).c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return false;
  const bool locked = ::flock(descriptor, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  ::close(descriptor);
  return locked;
}

}  // namespace oted
