// A library to preload (LD_PRELOAD) that makes one call on files of a folder fail: what crash.py drives. And two that
// measure drive it as well.
//
//   OTED_FAULT_FOLDER  absolute; only calls on files below it are counted
//   OTED_FAULT_COUNT   a file that gets a line with the name of each call, to learn how many there are
//   OTED_FAULT         "N KIND": what happens at call N (from 0): kill (the process dies before it), short (a write
//   takes
//                      half of its bytes), nospace (from here on the disk takes nothing more), ioerror (it fails once),
//                      leak (from here on each call loses 16 KiB, and a write a descriptor: what growth.py must notice)
//   OTED_FAULT_READS   set: the calls that read files are counted, in place of those that change them
//   OTED_CHEAP         sync: nothing is waited for; hash: nothing is hashed; both: neither (durability_cost.py)
//   OTED_TIMES         a file that gets, in the end, how long all syncs and all hashes took (durability_cost.py)
//
// Processes that this one starts run undisturbed.
//
// The calls are those through which the program changes files: open for writing, write, sync, truncate, rename, remove,
// new folder; or those that read them: open for reading (look), read.

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <climits>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <utility>

namespace {

enum class Kind { kNone, kKill, kShort, kNoSpace, kIoError, kLeak };
enum class Call { kOpen, kWrite, kSync, kTruncate, kRename, kRemove, kFolder, kLook, kRead };

constexpr const char* kNames[] = {"open", "write", "sync", "truncate", "rename", "remove", "folder", "look", "read"};
constexpr int kMaxFiles = 4096;

struct Settings {
  char folder[PATH_MAX] = "";
  long at = -1;
  Kind kind = Kind::kNone;
  int count = -1;  // descriptor
  bool reads = false;
  pid_t process = ::getpid();
  bool no_sync = false, no_hash = false;
};

template <class F>
F* Next(const char* name) {
  return reinterpret_cast<F*>(::dlsym(RTLD_NEXT, name));
}

const Settings& The() {
  static const Settings settings = [] {
    Settings s;
    if (const char* folder = std::getenv("OTED_FAULT_FOLDER")) std::snprintf(s.folder, sizeof s.folder, "%s", folder);
    if (const char* fault = std::getenv("OTED_FAULT")) {
      char* rest = nullptr;
      s.at = std::strtol(fault, &rest, 10);
      if (std::strcmp(rest, " kill") == 0) s.kind = Kind::kKill;
      if (std::strcmp(rest, " short") == 0) s.kind = Kind::kShort;
      if (std::strcmp(rest, " nospace") == 0) s.kind = Kind::kNoSpace;
      if (std::strcmp(rest, " ioerror") == 0) s.kind = Kind::kIoError;
      if (std::strcmp(rest, " leak") == 0) s.kind = Kind::kLeak;
    }
    s.reads = std::getenv("OTED_FAULT_READS") != nullptr;
    if (const char* cheap = std::getenv("OTED_CHEAP")) {
      s.no_sync = std::strcmp(cheap, "sync") == 0 || std::strcmp(cheap, "both") == 0;
      s.no_hash = std::strcmp(cheap, "hash") == 0 || std::strcmp(cheap, "both") == 0;
    }
    if (const char* file = std::getenv("OTED_FAULT_COUNT")) {
      s.count = Next<int(const char*, int, ...)>("open")(file, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    }
    ::unsetenv("OTED_FAULT");
    ::unsetenv("OTED_FAULT_COUNT");
    return s;
  }();
  return settings;
}

std::atomic<bool> g_watched[kMaxFiles];
std::atomic<long> g_calls{0};
std::atomic<bool> g_full{false};

bool IsBelow(const char* path) {
  const char* folder = The().folder;
  if (folder[0] == '\0' || path == nullptr) return false;
  char whole[2 * PATH_MAX];
  if (path[0] == '/') {
    std::snprintf(whole, sizeof whole, "%s", path);
  } else {
    char here[PATH_MAX];
    if (::getcwd(here, sizeof here) == nullptr) return false;
    std::snprintf(whole, sizeof whole, "%s/%s", here, path);
  }
  return std::strncmp(whole, folder, std::strlen(folder)) == 0;
}

bool IsWatched(int fd) { return fd >= 0 && fd < kMaxFiles && g_watched[fd]; }

/// How long calls of one kind took, on all threads together.
struct Clocked {
  std::atomic<int64_t> nanoseconds{0}, calls{0};
  template <class F>
  auto operator()(const F& call) {
    const auto start = std::chrono::steady_clock::now();
    const auto result = call();
    nanoseconds += (std::chrono::steady_clock::now() - start).count();
    ++calls;
    return result;
  }
};
Clocked g_syncs, g_hashes;

void* volatile g_lost = nullptr;  // memory that nobody sees the compiler does not take at all

void Leak(Call call) {
  constexpr size_t kLost = 16384;
  g_lost = std::memset(std::malloc(kLost), 1, kLost);
  if (call == Call::kWrite) ::fcntl(0, F_DUPFD_CLOEXEC, 3);
}

/// What happens to this call. @return kNone: it goes on as if nothing were
Kind Meet(Call call) {
  const Settings& s = The();
  if (s.process != ::getpid()) return Kind::kNone;
  if (s.reads != (call == Call::kLook || call == Call::kRead)) return Kind::kNone;
  const long n = g_calls++;
  if (s.count >= 0) {
    const char* name = kNames[static_cast<int>(call)];
    char line[32];
    const int size = std::snprintf(line, sizeof line, "%s\n", name);
    if (Next<ssize_t(int, const void*, size_t)>("write")(s.count, line, static_cast<size_t>(size)) < 0) ::_exit(99);
  }
  if (g_full) return call == Call::kRemove || call == Call::kTruncate ? Kind::kNone : Kind::kNoSpace;
  if (s.kind == Kind::kLeak && n >= s.at) Leak(call);
  if (n != s.at || s.kind == Kind::kLeak) return Kind::kNone;
  if (s.kind == Kind::kKill) ::kill(::getpid(), SIGKILL);
  if (s.kind == Kind::kNoSpace) g_full = true;
  if (s.kind == Kind::kNoSpace && call == Call::kRemove) return Kind::kNone;
  return s.kind;
}

bool Fails(Kind kind) {
  if (kind == Kind::kNoSpace) errno = ENOSPC;
  if (kind == Kind::kIoError) errno = EIO;
  return kind == Kind::kNoSpace || kind == Kind::kIoError;
}

void Watch(int fd, bool watched) {
  if (fd >= 0 && fd < kMaxFiles) g_watched[fd] = watched;
}

bool Writes(int flags) { return (flags & O_ACCMODE) != O_RDONLY || (flags & (O_CREAT | O_TRUNC)) != 0; }

int Open(const char* name, const char* path, int flags, mode_t mode) {
  const bool below = IsBelow(path);
  if (below && Fails(Meet(Writes(flags) ? Call::kOpen : Call::kLook))) return -1;
  const int fd = Next<int(const char*, int, ...)>(name)(path, flags, mode);
  Watch(fd, below);
  return fd;
}

FILE* OpenStream(const char* name, const char* path, const char* mode) {
  const bool below = IsBelow(path);
  if (below && Fails(Meet(std::strpbrk(mode, "wa+") != nullptr ? Call::kOpen : Call::kLook))) return nullptr;
  FILE* file = Next<FILE*(const char*, const char*)>(name)(path, mode);
  if (file != nullptr) Watch(::fileno(file), below);
  return file;
}

/// Before a child is forked, which would take itself for the program that is watched.
__attribute__((constructor)) void ReadSettings() { The(); }

__attribute__((destructor)) void TellTimes() {
  const char* file = std::getenv("OTED_TIMES");
  FILE* times = file == nullptr ? nullptr : Next<FILE*(const char*, const char*)>("fopen")(file, "w");
  if (times == nullptr) return;
  for (const auto& [name, clocked] : {std::pair{"sync", &g_syncs}, {"hash", &g_hashes}}) {
    std::fprintf(times, "%s %.6f %ld\n", name, 1e-9 * static_cast<double>(clocked->nanoseconds.load()),
                 static_cast<long>(clocked->calls.load()));
  }
  std::fclose(times);
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(list, mode_t) : 0;
  va_end(list);
  return Open("open", path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(list, mode_t) : 0;
  va_end(list);
  return Open("open64", path, flags, mode);
}
FILE* fopen(const char* path, const char* mode) { return OpenStream("fopen", path, mode); }
FILE* fopen64(const char* path, const char* mode) { return OpenStream("fopen64", path, mode); }

int close(int fd) {
  Watch(fd, false);
  return Next<int(int)>("close")(fd);
}

ssize_t write(int fd, const void* bytes, size_t size) {
  if (IsWatched(fd)) {
    const Kind kind = Meet(Call::kWrite);
    if (Fails(kind)) return -1;
    if (kind == Kind::kShort) size = (size + 1) / 2;
  }
  return Next<ssize_t(int, const void*, size_t)>("write")(fd, bytes, size);
}
ssize_t pwrite(int fd, const void* bytes, size_t size, off_t offset) {
  if (IsWatched(fd)) {
    const Kind kind = Meet(Call::kWrite);
    if (Fails(kind)) return -1;
    if (kind == Kind::kShort) size = (size + 1) / 2;
  }
  return Next<ssize_t(int, const void*, size_t, off_t)>("pwrite")(fd, bytes, size, offset);
}
ssize_t pwrite64(int fd, const void* bytes, size_t size, off64_t offset) { return pwrite(fd, bytes, size, offset); }
ssize_t writev(int fd, const iovec* parts, int n) {
  if (IsWatched(fd)) {
    const Kind kind = Meet(Call::kWrite);
    if (Fails(kind)) return -1;
    if (kind == Kind::kShort) n = 1;
  }
  return Next<ssize_t(int, const iovec*, int)>("writev")(fd, parts, n);
}
ssize_t read(int fd, void* bytes, size_t size) {
  if (IsWatched(fd) && Fails(Meet(Call::kRead))) return -1;
  return Next<ssize_t(int, void*, size_t)>("read")(fd, bytes, size);
}
ssize_t pread(int fd, void* bytes, size_t size, off_t offset) {
  if (IsWatched(fd) && Fails(Meet(Call::kRead))) return -1;
  return Next<ssize_t(int, void*, size_t, off_t)>("pread")(fd, bytes, size, offset);
}
ssize_t pread64(int fd, void* bytes, size_t size, off64_t offset) { return pread(fd, bytes, size, offset); }
int EVP_DigestUpdate(void* context, const void* bytes, size_t size) {
  if (The().no_hash) return 1;
  return g_hashes([&] { return Next<int(void*, const void*, size_t)>("EVP_DigestUpdate")(context, bytes, size); });
}
int fsync(int fd) {
  if (The().no_sync) return 0;
  if (IsWatched(fd) && Fails(Meet(Call::kSync))) return -1;
  return g_syncs([&] { return Next<int(int)>("fsync")(fd); });
}
int ftruncate(int fd, off_t size) {
  if (IsWatched(fd) && Fails(Meet(Call::kTruncate))) return -1;
  return Next<int(int, off_t)>("ftruncate")(fd, size);
}
int ftruncate64(int fd, off64_t size) { return ftruncate(fd, size); }
int rename(const char* from, const char* to) {
  if (IsBelow(to) && Fails(Meet(Call::kRename))) return -1;
  return Next<int(const char*, const char*)>("rename")(from, to);
}
int unlink(const char* path) {
  if (IsBelow(path) && Fails(Meet(Call::kRemove))) return -1;
  return Next<int(const char*)>("unlink")(path);
}
int remove(const char* path) {
  if (IsBelow(path) && Fails(Meet(Call::kRemove))) return -1;
  return Next<int(const char*)>("remove")(path);
}
int mkdir(const char* path, mode_t mode) {
  if (IsBelow(path) && Fails(Meet(Call::kFolder))) return -1;
  return Next<int(const char*, mode_t)>("mkdir")(path, mode);
}

}  // extern "C"
