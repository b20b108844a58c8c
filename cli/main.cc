// The program: dispatches to the verbs, turns errors into one line and an exit code (docs/exit_codes.md).

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <string>

#include "cli/options.h"
#include "cli/verbs.h"
#include "oted/base/error.h"

namespace {

std::string OneLine(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

int Main(int argc, char** argv) {
  using namespace oted;
  cli::Program program;
  program.command_line = cli::CommandLine(argc, argv);
  program.app.set_version_flag("--version", "oted " OTED_VERSION);
  program.app.require_subcommand(1);
  cli::AddRunVerb(program);
  cli::AddStageVerbs(program);
  cli::AddCollectVerb(program);
  cli::AddBehaviorVerb(program);
  cli::AddReportVerb(program);
  cli::InstallStopHandler();
  try {
    program.app.parse(argc, argv);
    return program.exit_code;
  } catch (const CLI::ParseError& e) {
    // --help and --version arrive as "errors" with code 0.
    if (e.get_exit_code() == 0) return program.app.exit(e);
    fmt::print(stderr, "oted: {}; 'oted --help' lists the verbs, 'oted VERB --help' what each takes\n",
               OneLine(e.what()));
    return static_cast<int>(ExitCode::kUsage);
  } catch (const Error& e) {
    fmt::print(stderr, "oted: {}\n", e.what());
    return static_cast<int>(e.exit_code());
  } catch (const std::exception& e) {
    fmt::print(stderr, "oted: internal error: {}; please report it\n", e.what());
    return static_cast<int>(ExitCode::kInternal);
  }
}

}  // namespace

int main(int argc, char** argv) { return Main(argc, argv); }
