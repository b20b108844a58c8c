#pragma once
/// What the terminal and the report say in the same words.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cctype>
#include <string>
#include <vector>

namespace oted {

/// "a", "a and b", "a, b and c".
inline std::string Enumerate(const std::vector<std::string>& items) {
  std::string text;
  for (size_t i = 0; i < items.size(); ++i) {
    if (i > 0) text += i + 1 == items.size() ? " and " : ", ";
    text += items[i];
  }
  return text;
}

/// Clauses between semicolons as sentences of their own: "a; b" becomes "a. B".
inline std::string Sentences(std::string clauses) {
  for (size_t at = clauses.find("; "); at != std::string::npos; at = clauses.find("; ", at)) {
    clauses[at] = '.';
    if (at + 2 < clauses.size()) {
      clauses[at + 2] = static_cast<char>(std::toupper(static_cast<unsigned char>(clauses[at + 2])));
    }
  }
  return clauses;
}

/// Under a table some of whose channels have a star.
inline constexpr const char* kStarredChannels =
    "* as it seems computed from positions, or late: no verdict rests on it (if it is late, obs/NAME/delay says by how "
    "much)";

/// Why a percentage may be less than a table shows. @param channels  in which an error is larger than their spread
inline std::string CountedAtMost(const std::vector<std::string>& channels) {
  return fmt::format(
      "Percentages count an error as the channel's spread over the logs at most, which the nominal simulator's exceeds "
      "in {}",
      Enumerate(channels));
}

/// What a star means to whoever uses a policy.
inline std::string StarredForPolicies(const std::vector<std::string>& channels) {
  return fmt::format(
      "simulators show {} exactly and at once, the robot computed or late: a policy that reads them meets other "
      "numbers there; make their delay a parameter (obs/NAME/delay), or leave them out of the observations",
      fmt::join(channels, ", "));
}

}  // namespace oted
