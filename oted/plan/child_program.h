#pragma once
/// Other programs, started and watched.

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace oted {

/// Runs beside this process, in a process group of its own, so that a signal from the terminal reaches this process
/// alone. The system kills it when this process dies.
class ChildProgram {
 public:
  /// No program and no signal leaves it.
  static constexpr int kUnknownEnd = 256;

  /// @param words  the program and its arguments  @param output  file that takes both streams at its end
  /// @throws DataError when it cannot be started
  ChildProgram(const std::vector<std::string>& words, const std::filesystem::path& output);
  /// Kills it where it still runs.
  ~ChildProgram();
  ChildProgram(ChildProgram&& other) noexcept;
  ChildProgram& operator=(ChildProgram&&) = delete;

  /// The exit code, or 128 and the signal that ended it; none while it runs. kUnknownEnd where it has ended and the
  /// system kept no status, as where this process ignores SIGCHLD.
  std::optional<int> Poll();
  /// To its whole group.
  void Signal(int signal);

 private:
  int pid_ = -1;
  std::optional<int> exit_code_;
};

/// What a program prints. @throws DataError with what it says on stderr when it ends with another code than 0, or is
/// not there
std::string OutputOf(const std::vector<std::string>& words);

/// The path of the program that runs.
std::filesystem::path ThisProgram();

/// Quoted where a shell needs it.
std::string ShellWord(const std::string& word);
std::string ShellLine(const std::vector<std::string>& words);

}  // namespace oted
