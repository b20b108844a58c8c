#include "cli/console.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "oted/base/error.h"

namespace oted::cli {
namespace {

[[noreturn]] void FailOutput(int error) {
  throw DataError(fmt::format(
      "cannot write to standard output: {}; what was computed is in its files: send the output elsewhere and "
      "run the command again",
      std::strerror(error)));
}

}  // namespace

void PrepareStreams() {
  for (int stream = STDIN_FILENO; stream <= STDERR_FILENO; ++stream) {
    if (::fcntl(stream, F_GETFD) >= 0 || errno != EBADF) continue;
    // The lowest free number is this one. Results must not seem to be printed: there it is not for writing.
    const int opened = ::open("/dev/null", stream == STDERR_FILENO ? O_WRONLY : O_RDONLY);
    if (opened >= 0 && opened != stream) ::close(opened);
  }
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

void PrintText(std::string_view text) {
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) FailOutput(errno);
}

void FinishOutput() {
  if (std::fflush(stdout) != 0) FailOutput(errno);
}

void Say(std::string_view text) {
  std::fwrite(text.data(), 1, text.size(), stderr);
  std::fflush(stderr);
}

}  // namespace oted::cli
