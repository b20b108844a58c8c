#include "cli/session.h"

#include "cli/stop.h"
#include "cli/versions.h"
#include "oted/base/parallel.h"

namespace oted::cli {

RunContext MakeContext(LogSink& log, int threads) {
  RunContext context;
  context.log = &log;
  context.stop = &g_stop;
  context.n_threads = threads > 0 ? threads : AvailableThreads();
  return context;
}

Session::Session(const Options& options, const std::string& command_line) : terminal_(options.quiet) {
  const std::string started = Now();
  const RunConfig config = ResolveConfig(options);
  log_ = std::make_unique<FileSink>(options.out, &terminal_);
  pipeline_ = std::make_unique<Pipeline>(config, options.out, MakeContext(*log_, config.run.threads));
  WriteVersions(options.out, command_line, started);
}

}  // namespace oted::cli
