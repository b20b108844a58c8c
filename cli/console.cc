#include "cli/console.h"

#include <fcntl.h>
#include <poll.h>
#include <stdio_ext.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "cli/stop.h"
#include "oted/base/error.h"

namespace oted::cli {
namespace {

/// How long a stop waits for stderr to take a line, and how often a wait looks whether there is a stop.
constexpr int kPatienceMs = 100;
/// A pipe that takes anything takes so much at once.
constexpr size_t kPiece = 4096;
static_assert(kPiece <= PIPE_BUF);

/// Waits until stderr takes a piece. @return false when it takes none, and there is a stop to be answered
bool StderrTakesMore() {
  for (;;) {
    const bool stops = g_stop;
    pollfd entry{STDERR_FILENO, POLLOUT, 0};
    const int ready = ::poll(&entry, 1, kPatienceMs);
    if (ready > 0) return true;
    if (ready < 0 && errno != EINTR) return true;  // the write will say
    if (ready == 0 && stops) return false;
  }
}

[[noreturn]] void FailOutput(int error) {
  if (g_stop) {
    ::__fpurge(stdout);  // the end of the program would wait for it again
    throw Interrupted();
  }
  if (error == EPIPE) {
    ::__fpurge(stdout);
    throw OutputClosed();
  }
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
  while (!text.empty() && StderrTakesMore()) {
    const ssize_t n = ::write(STDERR_FILENO, text.data(), std::min(text.size(), kPiece));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return;
    text.remove_prefix(static_cast<size_t>(n));
  }
}

}  // namespace oted::cli
