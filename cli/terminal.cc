#include "cli/terminal.h"

#include <fmt/format.h>
#include <pthread.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>

#include "cli/console.h"

namespace oted::cli {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kRedrawn{200};
constexpr std::chrono::seconds kTick{1};

std::string FormatDuration(double seconds) {
  const int s = static_cast<int>(seconds + 0.5);
  return s < 3600 ? fmt::format("{}:{:02}", s / 60, s % 60)
                  : fmt::format("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60);
}

int TerminalWidth() {
  winsize size{};
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 100;
}

}  // namespace

TerminalSink::TerminalSink(bool quiet) : quiet_(quiet), is_terminal_(isatty(STDERR_FILENO) != 0) {
  if (is_terminal_ && !quiet_) ticker_ = std::jthread([this](const std::stop_token& stop) { Tick(stop); });
}

TerminalSink::~TerminalSink() {
  const std::lock_guard lock(mutex_);
  FinishLine();
}

void TerminalSink::Tick(const std::stop_token& stop) {
  // Ctrl-C interrupts what works, not this.
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    ticks_.wait_for(lock, stop, kTick, [] { return false; });
    if (!stage_.empty() && !IsFinished() && Clock::now() - last_draw_ >= kTick) Draw();
  }
}

bool TerminalSink::IsFinished() const {
  return std::ranges::all_of(jobs_, [](const auto& job) { return job.second.done >= job.second.total; });
}

void TerminalSink::FinishLine() {
  if (stage_.empty() || quiet_) return;
  if (is_terminal_) Say("\n");
  stage_.clear();
}

void TerminalSink::Progress(std::string_view stage, std::string_view label, int64_t done, int64_t total,
                            std::string_view note) {
  const std::lock_guard lock(mutex_);
  if (quiet_) return;
  if (stage != stage_) {
    FinishLine();
    stage_ = stage;
    jobs_.clear();
    note_.clear();
    last_tenth_ = -1;
    stage_start_ = Clock::now();
    last_draw_ = {};
  }
  auto [job, is_new] = jobs_.try_emplace(std::string(label));
  if (is_new) job->second.first = done;
  job->second.done = done;
  job->second.total = total;
  if (!note.empty()) note_ = jobs_.size() > 1 ? fmt::format("{}: {}", label, note) : std::string(note);
  if (IsFinished() || Clock::now() - last_draw_ > kRedrawn) Draw();
}

void TerminalSink::Draw() {
  last_draw_ = Clock::now();
  const bool finished = IsFinished();
  int64_t first = 0, done = 0, total = 0;
  for (const auto& [label, job] : jobs_) {
    first += job.first;
    done += job.done;
    total += job.total;
  }
  const double fraction = total > 0 ? static_cast<double>(done) / static_cast<double>(total) : 1.0;
  const double elapsed = std::chrono::duration<double>(Clock::now() - stage_start_).count();
  // Before anything is done nobody knows.
  const std::string left =
      done > first ? FormatDuration(elapsed * static_cast<double>(total - done) / static_cast<double>(done - first))
                   : "?";
  const int tenth = static_cast<int>(10 * fraction);
  if (!is_terminal_ && tenth <= last_tenth_ && !finished) return;
  last_tenth_ = tenth;

  constexpr int kBarWidth = 24;
  const int filled = static_cast<int>(kBarWidth * fraction);
  std::string bar;
  for (int i = 0; i < kBarWidth; ++i) bar += i < filled ? "█" : "░";
  const std::string times = finished ? FormatDuration(elapsed) : fmt::format("{}<{}", FormatDuration(elapsed), left);
  const std::string head = fmt::format("{:<9} {} {:3.0f}%  [{}]", stage_, bar, 100 * fraction, times);
  if (is_terminal_) {
    const size_t room = static_cast<size_t>(std::max(0, TerminalWidth() - kBarWidth - 34));
    Say(fmt::format("\r{}  {}\x1b[K", head, note_.substr(0, room)));
  } else {
    Say(fmt::format("{}  {}\n", head, note_));
  }
}

void TerminalSink::Warning(std::string_view message) {
  const std::lock_guard lock(mutex_);
  FinishLine();
  Say(fmt::format("warning: {}\n", message));
}

}  // namespace oted::cli
