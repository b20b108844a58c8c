#pragma once
/// The program that verbs are added to. Each verb (cli/verbs) adds its subcommand; its callback does the work and
/// stores the exit code.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace oted::cli {

struct Program {
  Program() { app.get_formatter()->label("SUBCOMMAND", "COMMAND"); }

  CLI::App app{"oted fits your simulator to your logs, then trains in it."};
  std::string command_line;
  int exit_code = 0;
};

/// Runs a command within this one, as its words are. @return its exit code
int RunWords(const std::vector<std::string>& words);

}  // namespace oted::cli
