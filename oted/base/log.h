#pragma once
/// What the library tells while it works. It emits records; only the program prints.

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>

#include "oted/base/error.h"

namespace oted {

/// Receives the records of one run. Called from any thread; implementations lock.
class LogSink {
 public:
  virtual ~LogSink() = default;
  /// One scalar of a curve. `run` is the folder of the unit that emits it, relative to the run directory
  /// ("design/paper/1"); `key` follows Stable-Baselines3's names ("rollout/ep_rew_mean").
  virtual void Scalar(std::string_view run, std::string_view key, int64_t step, double value) = 0;
  /// `done` of `total` units of work of the stage's job `label` are complete; `note` is a short live figure.
  virtual void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                        std::string_view note) = 0;
  /// A finding that the user should read though the work goes on.
  virtual void Warning(std::string_view message) = 0;
};

/// Forgets everything.
class NullSink : public LogSink {
 public:
  void Scalar(std::string_view, std::string_view, int64_t, double) override {}
  void Progress(std::string_view, std::string_view, int64_t, int64_t, std::string_view) override {}
  void Warning(std::string_view) override {}
};

/// What every long computation gets: where to report and whether to stop.
struct RunContext {
  LogSink* log = nullptr;                   ///< never null while a stage runs
  const std::atomic<bool>* stop = nullptr;  ///< set by the program on Ctrl-C; may be null
  int n_threads = 1;                        ///< threads that the stage may use
  /// For one of `n_jobs` that run side by side on these threads: its share of them.
  RunContext ShareOf(size_t n_jobs) const {
    RunContext share = *this;
    share.n_threads = std::max(1, n_threads / static_cast<int>(std::max<size_t>(1, n_jobs)));
    return share;
  }
  bool StopRequested() const { return stop != nullptr && stop->load(std::memory_order_relaxed); }
  /// @throws Interrupted when a stop was requested. Call between units of work, where the state is on disk.
  void ThrowIfStopped() const {
    if (StopRequested()) throw Interrupted();
  }
};

}  // namespace oted
