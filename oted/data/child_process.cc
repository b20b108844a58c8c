#include "oted/data/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <new>
#include <optional>
#include <utility>

#include "oted/base/error.h"

namespace oted {
namespace {

#if defined(__has_feature)  // clang
#define OTED_ADDRESS_SANITIZER __has_feature(address_sanitizer)
#elif defined(__SANITIZE_ADDRESS__)  // GCC
#define OTED_ADDRESS_SANITIZER 1
#else
#define OTED_ADDRESS_SANITIZER 0
#endif
#if OTED_ADDRESS_SANITIZER
constexpr bool kAddressSanitizer = true;  // its shadow memory alone is terabytes of address space
#else
constexpr bool kAddressSanitizer = false;
#endif

/// A child that sleeps and uses no processor for so many looks waits for what never comes. Work that is held up by a
/// disk sleeps otherwise ("D").
constexpr int kLookMs = 500;
constexpr int kIdleLooks = 20;

constexpr const char* kRemedy = "the file is damaged or not what it claims to be: download or write it again";

// The first byte that the child sends.
constexpr char kResult = 'R';
constexpr char kDataError = 'D';
constexpr char kUsageError = 'U';
constexpr char kInternalError = 'I';
constexpr size_t kMaxMessage = 1 << 16;

/// Address space in use [bytes]; 0 when the system does not say.
uint64_t AddressSpace() {
  char text[128] = {};
  const int fd = ::open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
  if (fd < 0) return 0;
  const ssize_t size = ::read(fd, text, sizeof(text) - 1);
  ::close(fd);
  unsigned long long pages = 0;
  if (size <= 0 || std::sscanf(text, "%llu", &pages) != 1) return 0;
  return pages * static_cast<uint64_t>(::sysconf(_SC_PAGESIZE));
}

void Limit(int resource, uint64_t soft, uint64_t hard) {
  rlimit limit{};
  if (::getrlimit(static_cast<__rlimit_resource_t>(resource), &limit) != 0) return;
  limit.rlim_cur = std::min<rlim_t>(soft, limit.rlim_max);
  limit.rlim_max = std::min<rlim_t>(hard, limit.rlim_max);
  ::setrlimit(static_cast<__rlimit_resource_t>(resource), &limit);
}

void EnterLimits(const ChildLimits& limits) {
  // The child goes when the thread that waits for it does, and leaves Ctrl-C to its parent, which has a handler.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, SIG_IGN);
  for (const int signal : {SIGXCPU, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGPIPE}) {
    std::signal(signal, SIG_DFL);
  }
  Limit(RLIMIT_CORE, 0, 0);
  const uint64_t cpu_s = static_cast<uint64_t>(std::max(1, limits.cpu_s));
  Limit(RLIMIT_CPU, cpu_s, cpu_s + 1);
  if (kAddressSanitizer) return;
  Limit(RLIMIT_FSIZE, 0, 0);
  if (const uint64_t used = AddressSpace(); used > 0) {
    Limit(RLIMIT_AS, used + limits.memory_bytes, used + limits.memory_bytes);
  }
}

bool g_work_here = false;

/// Its result or its error goes to `fd`.
void Work(int fd, const std::string& file, const ChildLimits& limits, const std::function<void(ChildOutput&)>& work) {
  ChildOutput out(fd);
  try {
    work(out);
  } catch (const DataError& e) {
    out.Fail(kDataError, e.what());
  } catch (const UsageError& e) {
    out.Fail(kUsageError, e.what());
  } catch (const std::bad_alloc&) {
    out.Fail(kDataError, fmt::format("'{}': reading it needs more than {} MiB of memory; {}", file,
                                     limits.memory_bytes >> 20, kRemedy));
  } catch (const std::exception& e) {
    out.Fail(kInternalError, e.what());
  }
}

/// Processor time [ticks] of all its threads, if the first one sleeps, as in waiting for the other end of a pipe.
std::optional<uint64_t> TicksAsleep(int pid) {
  char text[512] = {};
  const int fd = ::open(fmt::format("/proc/{}/stat", pid).c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return std::nullopt;
  const ssize_t size = ::read(fd, text, sizeof(text) - 1);
  ::close(fd);
  // The name in brackets may hold anything; behind the last one stands the state.
  const char* end = size > 0 ? std::strrchr(text, ')') : nullptr;
  unsigned long long user = 0, system = 0;
  if (end == nullptr ||
      std::sscanf(end, ") S %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %llu %llu", &user, &system) != 2) {
    return std::nullopt;
  }
  return user + system;
}

int64_t MillisecondsUntil(std::chrono::steady_clock::time_point deadline) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
  return std::clamp<int64_t>(left.count() + 1, 0, 1 << 30);
}

}  // namespace

ChildLimits LimitsFor(uint64_t file_bytes, const ChildLimits& base) {
  const uint64_t mebibytes = std::min<uint64_t>(file_bytes >> 20, uint64_t{1} << 20);
  ChildLimits limits = base;
  limits.memory_bytes += mebibytes * (uint64_t{32} << 20);
  limits.cpu_s += static_cast<int>(mebibytes);
  limits.wall_s += static_cast<int>(3 * mebibytes);
  return limits;
}

void ChildOutput::Write(const void* bytes, size_t size) {
  if (!started_) Put(&kResult, 1);
  started_ = true;
  Put(bytes, size);
}

void ChildOutput::Fail(char kind, const std::string& message) {
  const uint64_t size = std::min(message.size(), kMaxMessage);
  Put(&kind, 1);
  Put(&size, sizeof(size));
  Put(message.data(), size);
}

void ChildOutput::Put(const void* bytes, size_t size) {
  const char* at = static_cast<const char*>(bytes);
  while (size > 0) {
    const ssize_t written = ::write(fd_, at, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) ::_exit(1);
    at += written;
    size -= static_cast<size_t>(written);
  }
}

ChildProcess::ChildProcess(std::string file, const ChildLimits& limits, std::mutex& library_lock,
                           const std::function<void(ChildOutput&)>& work)
    : file_(std::move(file)),
      limits_(limits),
      deadline_(std::chrono::steady_clock::now() + std::chrono::seconds(std::max(1, limits.wall_s))) {
  const auto fail = [&](const char* what) {
    throw DataError(fmt::format("'{}': cannot {} the process that reads it ({}); free memory or processes", file_, what,
                                std::strerror(errno)));
  };
  // The write end is closed before the lock goes: no other child can inherit it and keep the pipe open.
  const std::lock_guard lock(library_lock);
  if (g_work_here) {
    WorkHere(work);
    return;
  }
  int fds[2];
  if (::pipe2(fds, O_CLOEXEC) != 0) fail("reach");
  pid_ = ::fork();
  if (pid_ < 0) {
    ::close(fds[0]);
    ::close(fds[1]);
    fail("start");
  }
  if (pid_ == 0) {
    ::close(fds[0]);
    EnterLimits(limits_);
    Work(fds[1], file_, limits_, work);
    ::_exit(0);
  }
  ::close(fds[1]);
  fd_ = fds[0];
}

void ChildProcess::WorkHere() { g_work_here = true; }

void ChildProcess::WorkHere(const std::function<void(ChildOutput&)>& work) {
  fd_ = ::memfd_create("result", MFD_CLOEXEC);
  OTED_CHECK(fd_ >= 0);
  Work(fd_, file_, limits_, work);
  deadline_ = std::chrono::steady_clock::time_point::max();  // nothing is waited for
  OTED_CHECK(::lseek(fd_, 0, SEEK_SET) == 0);
}

ChildProcess::~ChildProcess() {
  if (fd_ >= 0) ::close(fd_);
  End();
}

int ChildProcess::End() {
  int status = 0;
  if (pid_ <= 0) return status;  // no process: -1 would be all of them
  ::kill(pid_, SIGKILL);
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  return status;
}

void ChildProcess::FailEnded() {
  // The pipe is closed, so it is dead or about to be; what closed it and lives on is not waited for.
  while (pid_ > 0 && MillisecondsUntil(deadline_) > 0) {
    siginfo_t info{};
    if (::waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) != 0 || info.si_pid == pid_) break;
    ::poll(nullptr, 0, 1);
  }
  const int status = End();
  const int signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  if (signal == SIGXCPU) {
    throw DataError(
        fmt::format("'{}': reading it took more than {} s of processor time; {}", file_, limits_.cpu_s, kRemedy));
  }
  if (signal == SIGABRT) {  // so libraries end where memory is out
    throw DataError(
        fmt::format("'{}': reading it broke off (signal {}): it is damaged, or needs more than {} MiB of memory; "
                    "repair it, or make it smaller",
                    file_, signal, limits_.memory_bytes >> 20));
  }
  if (signal != 0) throw DataError(fmt::format("'{}': reading it crashed (signal {}); {}", file_, signal, kRemedy));
  throw DataError(fmt::format("'{}': reading it broke off (exit status {}); {}", file_,
                              WIFEXITED(status) ? WEXITSTATUS(status) : -1, kRemedy));
}

void ChildProcess::FailIdle() {
  End();
  throw DataError(fmt::format(
      "'{}': reading it waits for what does not come, such as a pipe that it names; name files that have an "
      "end",
      file_));
}

void ChildProcess::FailTimeout() {
  End();
  throw DataError(fmt::format("'{}': reading it took more than {} s; {}", file_, limits_.wall_s, kRemedy));
}

size_t ChildProcess::ReadSome(void* bytes, size_t size) {
  char* to = static_cast<char*>(bytes);
  size_t got = 0;
  int n_asleep = 0;
  std::optional<uint64_t> ticks;
  while (got < size) {
    pollfd entry{fd_, POLLIN, 0};
    const int64_t wait_ms = std::min<int64_t>(MillisecondsUntil(deadline_), kLookMs);
    const int ready = wait_ms == 0 ? 0 : ::poll(&entry, 1, static_cast<int>(wait_ms));
    if (ready < 0 && errno == EINTR) continue;
    if (ready == 0) {
      if (MillisecondsUntil(deadline_) == 0) FailTimeout();
      const std::optional<uint64_t> before = std::exchange(ticks, TicksAsleep(pid_));
      n_asleep = ticks && ticks == before ? n_asleep + 1 : 0;
      if (n_asleep == kIdleLooks) FailIdle();
      continue;
    }
    const ssize_t n = ready < 0 ? -1 : ::read(fd_, to + got, size - got);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    got += static_cast<size_t>(n);
  }
  return got;
}

void ChildProcess::Read(void* bytes, size_t size) {
  if (!started_reading_) {
    started_reading_ = true;
    char kind = 0;
    if (ReadSome(&kind, 1) != 1) FailEnded();
    if (kind != kResult) {
      uint64_t length = 0;
      if (ReadSome(&length, sizeof(length)) != sizeof(length) || length > kMaxMessage) FailEnded();
      std::string message(length, '\0');
      if (ReadSome(message.data(), length) != length) FailEnded();
      if (kind == kDataError) throw DataError(message);
      if (kind == kUsageError) throw UsageError(message);
      throw InternalError(message);
    }
  }
  if (ReadSome(bytes, size) != size) FailEnded();
}

}  // namespace oted
