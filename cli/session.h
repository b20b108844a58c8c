#pragma once
/// What a command works with: a pipeline with its log, or threads and a log alone.

#include <memory>
#include <string>

#include "cli/options.h"
#include "cli/terminal.h"
#include "oted/report/file_sink.h"
#include "oted/run/pipeline.h"

namespace oted::cli {

/// A pipeline with its log: files in the run directory and bars on the terminal.
class Session {
 public:
  /// @param command_line for the record
  Session(const Options& options, const std::string& command_line);
  Pipeline& pipeline() { return *pipeline_; }

 private:
  TerminalSink terminal_;
  std::unique_ptr<FileSink> log_;
  std::unique_ptr<Pipeline> pipeline_;
};

/// Threads and log of a command that needs no pipeline.
RunContext MakeContext(LogSink& log, int threads);

}  // namespace oted::cli
