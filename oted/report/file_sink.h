#pragma once
/// Keeps the scalars of a run: curves.csv and a TensorBoard event file in the folder of each unit of work.

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "oted/base/curves_log.h"

namespace oted {

/// Thread-safe. Scalars go to <run_dir>/<run>/curves.csv and <run_dir>/<run>/events.out.tfevents.*, opened at a unit's
/// first scalar and closed when it has its result.
class FileSink : public CurvesLog {
 public:
  /// @param inner  receives Progress and Warning; may be null, else outlives this sink
  explicit FileSink(std::filesystem::path run_dir, LogSink* inner = nullptr);
  ~FileSink() override;

  void Finish(std::string_view run) override;
  std::string CurvesMark(std::string_view run) override;
  void GoOn(std::string_view run, std::string_view mark) override;
  /// @throws DataError when the files cannot be written.
  void Scalar(std::string_view run, std::string_view key, int64_t step, double value) override;
  void Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                std::string_view note) override;
  void Warning(std::string_view message) override;

 private:
  struct Files;
  /// Opens them where they are not open; the lock is held. @param least  what the curves must begin with, a mark
  Files& FilesOf(std::string_view run, std::string_view least = "");

  std::filesystem::path run_dir_;
  LogSink* inner_;
  std::mutex mutex_;
  std::map<std::string, std::unique_ptr<Files>, std::less<>> files_;
};

}  // namespace oted
