#include "oted/report/file_sink.h"

#include <fmt/format.h>

#include "oted/report/curves.h"
#include "oted/report/tensorboard.h"

namespace oted {

struct FileSink::Files {
  Files(const std::filesystem::path& folder, std::string_view least)
      : curves(folder / "curves.csv", least), events(folder) {}
  CurvesWriter curves;
  EventFileWriter events;
};

FileSink::FileSink(std::filesystem::path run_dir, LogSink* inner) : run_dir_(std::move(run_dir)), inner_(inner) {}

FileSink::~FileSink() = default;

FileSink::Files& FileSink::FilesOf(std::string_view run, std::string_view least) {
  auto found = files_.find(run);
  if (found == files_.end()) {
    found = files_.emplace(std::string(run), std::make_unique<Files>(run_dir_ / run, least)).first;
    if (found->second->curves.set_aside()) {
      Warning(
          fmt::format("'{}' was damaged, cut short or removed: what is left of it, if anything, is kept as "
                      "curves.csv.damaged, and the curves go on in a new file",
                      (run_dir_ / run / "curves.csv").string()));
    }
  }
  return *found->second;
}

void FileSink::Scalar(std::string_view run, std::string_view key, int64_t step, double value) {
  const std::lock_guard lock(mutex_);
  Files& files = FilesOf(run);
  files.curves.Append(step, key, value);
  files.events.Scalar(key, step, value);
}

std::string FileSink::CurvesMark(std::string_view run) {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(run);
  return found == files_.end() ? "" : found->second->curves.MarkOfAll();
}

void FileSink::GoOn(std::string_view run, std::string_view mark) {
  const std::lock_guard lock(mutex_);
  if (!mark.empty()) FilesOf(run, mark);
}

void FileSink::Finish(std::string_view run) {
  const std::lock_guard lock(mutex_);
  const auto found = files_.find(run);
  if (found != files_.end()) files_.erase(found);
}

void FileSink::Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                        std::string_view note) {
  if (inner_ != nullptr) inner_->Progress(stage, label, done, total, note);
}

void FileSink::Warning(std::string_view message) {
  if (inner_ != nullptr) inner_->Warning(message);
}

}  // namespace oted
