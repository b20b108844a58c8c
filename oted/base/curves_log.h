#pragma once
/// A log that keeps the curves of units of work in files.

#include <string_view>

#include "oted/base/log.h"

namespace oted {

/// What the run directory tells a log that keeps curves. `run` is as in LogSink::Scalar.
class CurvesLog : public LogSink {
 public:
  /// The unit has its result: no scalar of it follows, and its files are closed.
  virtual void Finish(std::string_view run) = 0;
};

/// Null where `log` keeps no curves.
inline CurvesLog* CurvesOf(LogSink* log) { return dynamic_cast<CurvesLog*>(log); }

}  // namespace oted
