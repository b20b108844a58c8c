#include "cli/stop.h"

#include <sys/time.h>
#include <unistd.h>

#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <string_view>
#include <utility>

#include "oted/base/error.h"

namespace oted::cli {

std::atomic<bool> g_stop{false};

namespace {

/// For work to come to where its state is on the disk. Then the program ends where it stands: files are whole at any
/// moment, and the work since the last checkpoint is done again.
constexpr timeval kGrace = {1, 500'000};
/// For a line to where stderr leads: a pipe that nobody reads or a stopped terminal takes none.
constexpr timeval kGraceOfLine = {0, 100'000};

constexpr int64_t kSameSignal = 300;  // [ms]

std::atomic<bool> g_has_children{false};
std::atomic<const std::string*> g_last_words{nullptr};
std::atomic<int64_t> g_asked_at{0};  // [ms]

int64_t Now() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1000 + now.tv_nsec / 1'000'000;
}

extern "C" void OnInterrupt(int) {
  if (g_stop.exchange(true)) {
    if (Now() - g_asked_at > kSameSignal) std::_Exit(static_cast<int>(ExitCode::kInterrupted));
    return;
  }
  g_asked_at = Now();
  if (g_has_children) return;
  const itimerval grace = {{0, 0}, kGrace};
  ::setitimer(ITIMER_REAL, &grace, nullptr);
}

/// The system sends it every second from the limit on (ulimit -t), which is one request to stop.
extern "C" void OnProcessorTimeOver(int signal) {
  if (!g_stop) OnInterrupt(signal);
}

extern "C" void OnGraceOver(int) {
  static std::atomic<bool> writes{false};
  if (writes.exchange(true)) std::_Exit(static_cast<int>(ExitCode::kInterrupted));
  const itimerval grace = {{0, 0}, kGraceOfLine};
  ::setitimer(ITIMER_REAL, &grace, nullptr);
  if (const std::string* const words = g_last_words) {
    [[maybe_unused]] const ssize_t unused = ::write(STDOUT_FILENO, words->data(), words->size());
  }
  for (const std::string_view part : {"\noted: ", Interrupted::kGoOn, "\n"}) {
    [[maybe_unused]] const ssize_t unused = ::write(STDERR_FILENO, part.data(), part.size());
  }
  std::_Exit(static_cast<int>(ExitCode::kInterrupted));
}

}  // namespace

void InstallStopHandler() {
  struct sigaction action {};
  action.sa_handler = OnInterrupt;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // A terminal that goes away, unless nohup keeps the program.
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN) sigaction(SIGHUP, &action, nullptr);
  action.sa_handler = OnProcessorTimeOver;
  sigaction(SIGXCPU, &action, nullptr);
  action.sa_handler = OnGraceOver;
  action.sa_flags = SA_NODEFER;  // the line it writes has a grace of its own
  sigaction(SIGALRM, &action, nullptr);
  // Whoever starts this program may ignore it, and then nobody learns how a child ended,
  std::signal(SIGCHLD, SIG_DFL);
  // or may block what asks it to stop.
  sigset_t answered;
  sigemptyset(&answered);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGXCPU, SIGALRM}) sigaddset(&answered, signal);
  sigprocmask(SIG_UNBLOCK, &answered, nullptr);
}

void WaitForChildrenOnStop() { g_has_children = true; }

LastWords::LastWords(std::string words) : words_(std::move(words)) { g_last_words = &words_; }
LastWords::~LastWords() { g_last_words = nullptr; }

}  // namespace oted::cli
