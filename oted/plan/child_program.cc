#include "oted/plan/child_program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

constexpr int kNotStarted = 127;

std::vector<char*> PointersTo(std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  return pointers;
}

/// In the child, from fork to exec: only what may be called there.
[[noreturn]] void Become(const std::vector<char*>& words, int output, int parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  ::setpgid(0, 0);
  const int null = ::open("/dev/null", O_RDONLY);
  const bool ready = null >= 0 && ::dup2(null, STDIN_FILENO) >= 0 && ::dup2(output, 1) >= 0 && ::dup2(output, 2) >= 0;
  // Ignored signals stay ignored in a new program.
  ::signal(SIGPIPE, SIG_DFL);
  ::signal(SIGXFSZ, SIG_DFL);
  if (ready && ::getppid() == parent) ::execvp(words[0], words.data());
  ::_exit(kNotStarted);
}

int CodeOf(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status); }

}  // namespace

ChildProgram::ChildProgram(const std::vector<std::string>& words, const fs::path& output) {
  const OpenFile file(output, O_WRONLY | O_CREAT | O_APPEND);
  std::vector<std::string> copies = words;
  const std::vector<char*> pointers = PointersTo(copies);
  const int parent = ::getpid();
  pid_ = ::fork();
  if (pid_ == 0) Become(pointers, file.descriptor(), parent);
  if (pid_ < 0) {
    throw DataError(fmt::format("cannot start '{}': {}; free memory or processes, and run the same command again",
                                words.at(0), std::strerror(errno)));
  }
}

ChildProgram::ChildProgram(ChildProgram&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)), exit_code_(other.exit_code_) {}

ChildProgram::~ChildProgram() {
  if (pid_ <= 0 || exit_code_) return;
  ::kill(-pid_, SIGKILL);
  ::kill(pid_, SIGKILL);
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

std::optional<int> ChildProgram::Poll() {
  if (exit_code_) return exit_code_;
  int status = 0;
  const pid_t ended = ::waitpid(pid_, &status, WNOHANG);
  if (ended == pid_) {
    exit_code_ = CodeOf(status);
  } else if (ended < 0 && errno == ECHILD) {
    // It is gone, and no later look would tell more.
    exit_code_ = kUnknownEnd;
  }
  return exit_code_;
}

void ChildProgram::Signal(int signal) {
  if (!exit_code_ && ::kill(-pid_, signal) != 0) ::kill(pid_, signal);
}

std::string OutputOf(const std::vector<std::string>& words) {
  const std::string line = ShellLine(words);
  const AtomicFile said(fs::temp_directory_path() / fmt::format("oted-said-{}", ::getpid()));
  const fs::path file = said.temporary_path();
  FILE* pipe = ::popen(fmt::format("{} 2>{}", line, ShellWord(file.string())).c_str(), "re");
  if (pipe == nullptr) throw DataError(fmt::format("cannot start '{}': {}", words.at(0), std::strerror(errno)));
  std::string text;
  char buffer[4096];
  for (size_t n = 0; (n = std::fread(buffer, 1, sizeof(buffer), pipe)) > 0;) text.append(buffer, n);
  const int code = CodeOf(::pclose(pipe));
  const std::string complaint = fs::exists(file) ? ReadFile(file) : "";
  fs::remove(file);
  if (code == 0) return text;
  throw DataError(fmt::format("'{}' ended with {}: {}", line, code,
                              code == kNotStarted ? "it is not installed here, or not in PATH" : complaint));
}

fs::path ThisProgram() { return fs::read_symlink("/proc/self/exe"); }

std::string ShellWord(const std::string& word) {
  constexpr const char* kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:,%+@";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string ShellLine(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) line += (line.empty() ? "" : " ") + ShellWord(word);
  return line;
}

}  // namespace oted
