#pragma once
/// Designs that are made to choose by, and not to keep.

#include <string>
#include <utility>

#include "oted/base/log.h"

namespace oted {

/// Curves of trials would stand among those of designs: their progress alone is told, as a stage of its own.
class TrialLog : public NullSink {
 public:
  TrialLog(LogSink* log, std::string stage) : log_(log), stage_(std::move(stage)) {}
  void Progress(std::string_view, std::string_view label, int64_t done, int64_t total, std::string_view note) override {
    log_->Progress(stage_, label, done, total, note);
  }

 private:
  LogSink* log_;
  std::string stage_;
};

}  // namespace oted
