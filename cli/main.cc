// Dispatches to the verbs, turns errors into one line and an exit code (docs/exit_codes.md).

#include "cli/main.h"

#include <fmt/format.h>

#include <exception>
#include <span>
#include <string>
#include <vector>

#include "cli/options.h"
#include "cli/verbs.h"
#include "oted/base/error.h"
#include "oted/base/fields.h"

namespace {

/// CLI11 would only say that a subcommand is missing.
void CheckVerbs(const CLI::App& app, std::span<char*> words) {
  const auto known = app.get_subcommands([](const CLI::App*) { return true; });
  if (known.empty() || words.empty() || words[0][0] == '-') return;
  const std::string word = words[0];
  std::vector<std::string> verbs;
  for (const CLI::App* verb : known) {
    if (verb->get_name() == word) return CheckVerbs(*verb, words.subspan(1));
    verbs.push_back(verb->get_name());
  }
  const std::string of = app.get_parent() == nullptr ? "" : " of '" + app.get_name() + "'";
  throw oted::UsageError(fmt::format("'{}' is no command{}{}; the commands are {}; 'oted{} --help' explains them", word,
                                     of, oted::DidYouMean(word, verbs), fmt::join(verbs, ", "),
                                     app.get_parent() == nullptr ? "" : " " + app.get_name()));
}

}  // namespace

int oted::cli::Main(int argc, char** argv) {
  cli::Program program;
  program.command_line = cli::CommandLine(argc, argv);
  program.app.set_version_flag("--version", "oted " OTED_VERSION);
  program.app.require_subcommand(1);
  cli::AddRunVerb(program);
  cli::AddStageVerbs(program);
  cli::AddEvaluateVerb(program);
  cli::AddCollectVerb(program);
  cli::AddBehaviorVerb(program);
  cli::AddParamsVerb(program);
  cli::AddReportVerb(program);
  cli::AddDataVerb(program);
  cli::AddExportVerb(program);
  cli::AddReproduceVerb(program);
  cli::InstallStopHandler();
  try {
    CheckVerbs(program.app, std::span(argv, static_cast<size_t>(argc)).subspan(1));
    program.app.parse(argc, argv);
    return program.exit_code;
  } catch (const CLI::ParseError& e) {
    // --help and --version arrive as "errors" with code 0.
    if (e.get_exit_code() == 0) return program.app.exit(e);
    fmt::print(stderr, "oted: {}; 'oted --help' lists the commands, 'oted COMMAND --help' explains one\n",
               oted::Printable(e.what()));
    return static_cast<int>(ExitCode::kUsage);
  } catch (const Error& e) {
    fmt::print(stderr, "oted: {}\n", e.what());
    return static_cast<int>(e.exit_code());
  } catch (const std::exception& e) {
    fmt::print(stderr, "oted: internal error: {}; please report it\n", e.what());
    return static_cast<int>(ExitCode::kInternal);
  }
}
