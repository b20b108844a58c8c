#pragma once
/// What the program shows while it works: progress bars on stderr, results on stdout.

#include <chrono>
#include <condition_variable>
#include <map>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "oted/base/log.h"

namespace oted::cli {

/// One bar per stage: the jobs of a stage that run side by side share it. On a terminal the bar is redrawn in place,
/// and once a second where nothing is told: the time that is left grows then. Into a file a line is written at every
/// tenth.
class TerminalSink : public LogSink {
 public:
  explicit TerminalSink(bool quiet);
  ~TerminalSink() override;
  void Scalar(std::string_view, std::string_view, int64_t, double) override {}
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                std::string_view note) override;
  void Warning(std::string_view message) override;

 private:
  struct Job {
    int64_t first = 0, done = 0, total = 0;
  };
  bool IsFinished() const;
  void Draw();
  void FinishLine();
  /// Redraws a bar that stands still, until it is stopped.
  void Tick(const std::stop_token& stop);

  const bool quiet_, is_terminal_;
  std::mutex mutex_;
  std::string stage_, note_;
  std::map<std::string, Job, std::less<>> jobs_;
  int last_tenth_ = -1;
  std::chrono::steady_clock::time_point stage_start_, last_draw_;
  std::condition_variable_any ticks_;
  std::jthread ticker_;  // the last member: it ends before the others
};

}  // namespace oted::cli
