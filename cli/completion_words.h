#pragma once
/// What can follow on a command line, from the program's own commands and options.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace oted::cli {

struct CompletionWord {
  std::string text;
  std::string meaning;  ///< one line; may be empty
};

/// What the last word can become; none where a file name or a number belongs.
/// @param typed  the words behind the program's name; the last may be empty
std::vector<CompletionWord> CompletionWords(const CLI::App& app, const std::vector<std::string>& typed);

}  // namespace oted::cli
