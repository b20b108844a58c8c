#pragma once
/// A forked child process within limits, for libraries that a damaged file can crash, hang or make allocate.
///
/// Fork without exec: the library has no program of its own to start, and the child needs only what it inherits. That
/// is sound from a process with threads because the child touches none of them, takes no lock that another thread may
/// have held at the fork (`library_lock` is held by the forking thread; glibc makes malloc usable after fork), runs no
/// exit handler and flushes no stream (it ends in _exit). Should it hang all the same, its wall time ends it.

#include <chrono>
#include <cstddef>
#include <functional>
#include <mutex>
#include <string>

#include "oted/data/data_options.h"

namespace oted {

/// What the child writes its result to.
class ChildOutput {
 public:
  explicit ChildOutput(int fd) : fd_(fd) {}
  /// Writes all of it, or ends the child: nobody is left to tell.
  void Write(const void* bytes, size_t size);
  /// Writes an error in place of a result.
  void Fail(char kind, const std::string& message);

 private:
  void Put(const void* bytes, size_t size);
  int fd_;
  bool started_ = false;
};

/// A child that runs `work` and ends. What `work` throws comes out of Read as an error of the same kind.
class ChildProcess {
 public:
  /// `file` names the file that is being read, in errors. `library_lock` guards the library that `work` uses, as far as
  /// this process uses it; it is held during the fork only. `work` writes all of its result or throws before the first
  /// byte. @throws DataError when no process can be started.
  ChildProcess(std::string file, const ChildLimits& limits, std::mutex& library_lock,
               const std::function<void(ChildOutput&)>& work);
  /// Kills the child when it still runs.
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  /// From now on `work` runs in this process and without limits, which is quick: what fuzzing asks for, where a process
  /// that ends is one that is started again.
  static void WorkHere();

  /// The next bytes of the result. @throws DataError naming the file when the child failed, died, or ran past a limit.
  void Read(void* bytes, size_t size);

 private:
  void WorkHere(const std::function<void(ChildOutput&)>& work);
  /// Ends the child where there is one. @return its wait status
  int End();
  [[noreturn]] void FailEnded();
  [[noreturn]] void FailIdle();
  [[noreturn]] void FailTimeout();
  /// Fills `bytes` from the pipe. @return how many came before its end
  size_t ReadSome(void* bytes, size_t size);

  std::string file_;
  ChildLimits limits_;
  std::chrono::steady_clock::time_point deadline_;
  int fd_ = -1;
  int pid_ = -1;
  bool started_reading_ = false;
};

}  // namespace oted
