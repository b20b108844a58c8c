#pragma once
/// What the program shows while it works: progress bars on stderr, results on stdout.

#include <chrono>
#include <map>
#include <mutex>
#include <string>

#include "oted/base/log.h"

namespace oted::cli {

/// One bar per stage: the jobs of a stage that run side by side share it. On a terminal the bar is redrawn in place;
/// into a file a line is written at every tenth.
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
  void Draw(bool finished);
  void FinishLine();

  const bool quiet_, is_terminal_;
  std::mutex mutex_;
  std::string stage_, note_;
  std::map<std::string, Job, std::less<>> jobs_;
  int last_tenth_ = -1;
  std::chrono::steady_clock::time_point stage_start_, last_draw_;
};

}  // namespace oted::cli
