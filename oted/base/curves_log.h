#pragma once
/// A log that keeps the curves of units of work in files.

#include <string>
#include <string_view>

#include "oted/base/log.h"

namespace oted {

/// What stages and the run directory tell a log that keeps curves, and ask it. `run` is as in LogSink::Scalar.
class CurvesLog : public LogSink {
 public:
  /// The unit has its result: no scalar of it follows, and its files are closed.
  virtual void Finish(std::string_view run) = 0;
  /// How far its curves go, for a checkpoint to keep; empty where it has none yet.
  virtual std::string CurvesMark(std::string_view run) = 0;
  /// Its work goes on from a checkpoint that keeps `mark`: curves that do not go so far lack rows, and that is a
  /// warning.
  virtual void GoOn(std::string_view run, std::string_view mark) = 0;
};

/// Null where `log` keeps no curves.
inline CurvesLog* CurvesOf(LogSink* log) { return dynamic_cast<CurvesLog*>(log); }

}  // namespace oted
