#pragma once
/// The standard streams: results on stdout, everything else on stderr. A result that cannot be printed is an error; a
/// bar or warning that cannot be is not.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string_view>
#include <utility>

namespace oted::cli {

/// Opens /dev/null for standard streams that are closed, so that no file of a run gets their numbers, and lets a pipe
/// or file that takes no more be an error instead of a signal. To be called first.
void PrepareStreams();

/// Who read the output has enough of it, as `| head` has: nothing is left to tell.
struct OutputClosed {};

/// Writes to stdout. @throws OutputClosed when nobody reads it any more, DataError when it takes no more, Interrupted
/// when there is a stop, too
void PrintText(std::string_view text);
template <class... Args>
void Print(fmt::format_string<Args...> format, Args&&... args) {
  PrintText(fmt::format(format, std::forward<Args>(args)...));
}
/// Brings what was printed to where stdout leads. @throws as PrintText
void FinishOutput();

/// Writes to stderr, if that is possible. A pipe or terminal that takes nothing is waited for until there is a stop.
void Say(std::string_view text);

}  // namespace oted::cli
