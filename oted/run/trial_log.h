#pragma once
/// Designs that are made to choose by, and not to keep.

#include <fmt/format.h>

#include <string>
#include <utility>

#include "oted/base/log.h"

namespace oted {

/// Their progress is told as that of other work. Curves of trials that run beside one another would stand among those
/// of designs.
class TrialLog : public NullSink {
 public:
  enum class Stages {
    kOne,  ///< trials that run beside one another
    kEach  ///< one behind the other
  };
  TrialLog(LogSink* log, std::string stage, Stages stages) : log_(log), stage_(std::move(stage)), stages_(stages) {}
  void Scalar(std::string_view run, std::string_view key, int64_t step, double value) override {
    if (stages_ == Stages::kEach) log_->Scalar(run, key, step, value);
  }
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                std::string_view note) override {
    log_->Progress(stages_ == Stages::kOne ? stage_ : fmt::format("{} {}", stage_, stage), label, done, total, note);
  }

 private:
  LogSink* log_;
  std::string stage_;
  Stages stages_;
};

}  // namespace oted
