#pragma once
/// The program that verbs are added to. Each verb (cli/verbs) adds its subcommand; its callback does the work and
/// stores the exit code.

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace oted::cli {

class HelpFormatter : public CLI::Formatter {
 public:
  HelpFormatter() { label("SUBCOMMAND", "COMMAND"); }
  /// What may stand in its place as well need not be named.
  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    std::string text = CLI::Formatter::make_option(option, is_positional);
    const std::string required = " " + get_label("REQUIRED");
    const size_t at = text.find(required);
    if (at != std::string::npos && !is_positional && option->get_positional()) {
      text.replace(at, required.size(), std::string(required.size(), ' '));
    }
    return text;
  }
  /// One value at a time is no list, however often the option may be given.
  std::string make_option_opts(const CLI::Option* option) const override {
    std::string text = CLI::Formatter::make_option_opts(option);
    constexpr std::string_view kList = " ...";
    const size_t at = text.find(kList);
    if (at != std::string::npos && !option->get_allow_extra_args()) text.erase(at, kList.size());
    return text;
  }
};

struct Program {
  Program() { app.formatter(std::make_shared<HelpFormatter>()); }

  CLI::App app{"oted fits your simulator to your logs, then trains in it."};
  std::string command_line;
  int exit_code = 0;
};

/// Runs a command within this one, as its words are. @return its exit code
int RunWords(const std::vector<std::string>& words);

}  // namespace oted::cli
