#pragma once
/// Failures as exceptions. The library never prints and never exits: it throws, the program reports.
/// A message names what, got, wanted, where and the remedy, in one line.

#include <stdexcept>
#include <string>
#include <string_view>

namespace oted {

/// Exit codes of the program (docs/exit_codes.md). 0 is success.
enum class ExitCode : int {
  kDone = 0,
  kUsage = 2,
  kDataOrModel = 3,
  kNoSimulatorMatches = 4,
  kInternal = 70,
  kInterrupted = 130,
};

/// `text` as one line of valid UTF-8: a line break becomes a space, any other control character and what is no UTF-8
/// a '?', and of more than 4,000 bytes the middle is left out. What a damaged file holds reaches messages.
std::string Printable(std::string_view text);

/// Base of every error that this library throws. Its message is printable.
class Error : public std::runtime_error {
 public:
  Error(ExitCode exit_code, const std::string& message)
      : std::runtime_error(Printable(message)), exit_code_(exit_code) {}
  ExitCode exit_code() const { return exit_code_; }

 private:
  ExitCode exit_code_;
};

/// The request itself is wrong: an unknown key, a value outside its range, a missing argument.
class UsageError : public Error {
 public:
  explicit UsageError(const std::string& message) : Error(ExitCode::kUsage, message) {}
};

/// The data, the model or the file system does not allow what was asked.
class DataError : public Error {
 public:
  explicit DataError(const std::string& message) : Error(ExitCode::kDataOrModel, message) {}
};

/// The user stopped the work; what was complete is on disk and the same command goes on from there.
class Interrupted : public Error {
 public:
  explicit Interrupted(const std::string& message = kGoOn) : Error(ExitCode::kInterrupted, message) {}
  static constexpr const char* kGoOn = "interrupted; the same command goes on from what is complete, if anything is";
};

/// A bug in oted.
class InternalError : public Error {
 public:
  explicit InternalError(const std::string& message) : Error(ExitCode::kInternal, message) {}
};

namespace internal {
[[noreturn]] void CheckFailed(const char* condition, const char* file, int line);
}  // namespace internal

/// Throws InternalError when `condition` is false: for what only a bug in this program can cause.
#define OTED_CHECK(condition) \
  (static_cast<bool>(condition) ? void(0) : ::oted::internal::CheckFailed(#condition, __FILE__, __LINE__))

}  // namespace oted
