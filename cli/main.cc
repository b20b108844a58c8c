// Dispatches to the verbs, turns errors into one line and an exit code (docs/exit_codes.md).

#include "cli/main.h"

#include <fmt/format.h>

#include <exception>
#include <filesystem>
#include <initializer_list>
#include <new>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "cli/console.h"
#include "cli/program.h"
#include "cli/stop.h"
#include "cli/verbs/collect.h"
#include "cli/verbs/completion.h"
#include "cli/verbs/data.h"
#include "cli/verbs/evaluate.h"
#include "cli/verbs/export.h"
#include "cli/verbs/init.h"
#include "cli/verbs/merge.h"
#include "cli/verbs/params.h"
#include "cli/verbs/plan.h"
#include "cli/verbs/report.h"
#include "cli/verbs/reproduce.h"
#include "cli/verbs/schema.h"
#include "cli/verbs/stages.h"
#include "cli/verbs/submit.h"
#include "cli/verbs/sweep.h"
#include "cli/verbs/unit.h"
#include "cli/verbs/validate.h"
#include "cli/verbs/verify.h"
#include "cli/versions.h"
#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/base/system_error.h"
#include "oted/data/csv.h"

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

/// Names of files and settings end up in records, which are UTF-8.
void CheckWords(std::span<char*> words) {
  for (size_t i = 0; i < words.size(); ++i) {
    if (oted::IsUtf8(words[i])) continue;
    throw oted::UsageError(fmt::format(
        "argument {} ('{}') is not UTF-8; rename the file, or type it in a UTF-8 terminal", i + 1, words[i]));
  }
}

int Fail(oted::ExitCode code, const std::string& message) {
  oted::cli::Say("oted: " + oted::Printable(message) + "\n");
  return static_cast<int>(code);
}

/// Which help explains the command that was typed.
std::string WhereHelpIs(const CLI::App& app) {
  const std::vector<CLI::App*> typed = app.get_subcommands();
  if (!typed.empty()) return WhereHelpIs(*typed.front());
  if (app.get_parent() == nullptr) return "'oted --help' lists the commands, 'oted COMMAND --help' explains one";
  std::string words = app.get_name();
  for (const CLI::App* of = app.get_parent(); of->get_parent() != nullptr; of = of->get_parent()) {
    words = of->get_name() + " " + words;
  }
  return fmt::format("'oted {} --help' explains the command", words);
}

/// " (did you mean '--seed'?)" for a flag that the typed command does not have, or "".
std::string WhatWasMeant(const CLI::App& app) {
  const std::vector<CLI::App*> typed = app.get_subcommands();
  if (!typed.empty()) return WhatWasMeant(*typed.front());
  std::vector<std::string> flags;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) flags.push_back("--" + name);
  }
  for (const std::string& word : app.remaining()) {
    if (word.starts_with("--")) return oted::DidYouMean(word.substr(0, word.find('=')), flags);
  }
  return "";
}

/// The one line and the exit code of what is being thrown.
int FailOfException(const CLI::App& app) {
  using oted::ExitCode;
  try {
    throw;
  } catch (const CLI::ExtrasError& e) {
    return Fail(ExitCode::kUsage, fmt::format("{}{}; {}", e.what(), WhatWasMeant(app), WhereHelpIs(app)));
  } catch (const CLI::ParseError& e) {
    return Fail(ExitCode::kUsage, fmt::format("{}; {}", e.what(), WhereHelpIs(app)));
  } catch (const oted::cli::OutputClosed&) {
    return static_cast<int>(ExitCode::kDataOrModel);
  } catch (const oted::Error& e) {
    return Fail(e.exit_code(), e.what());
  } catch (const std::filesystem::filesystem_error& e) {
    // A name that no file can have is a wrong request.
    const bool is_name = e.code() == std::errc::filename_too_long || e.code() == std::errc::invalid_argument;
    return Fail(is_name ? ExitCode::kUsage : ExitCode::kDataOrModel,
                fmt::format("cannot use '{}': {}; {}", e.path1().string(), e.code().message(),
                            oted::RemedyOf(e.code().value())));
  } catch (const std::length_error&) {
    return Fail(ExitCode::kDataOrModel, "a list longer than any memory is asked for; lower sizes in the settings");
  } catch (const std::bad_alloc&) {
    return Fail(ExitCode::kDataOrModel,
                "there is not enough memory; use fewer threads (--threads), less data, or a machine with more, and run "
                "the same command again");
  } catch (const std::system_error& e) {
    return Fail(ExitCode::kDataOrModel,
                fmt::format("the system refuses what is needed ({}); {}", e.what(), oted::RemedyOf(e.code().value())));
  } catch (const std::exception& e) {
    return Fail(ExitCode::kInternal, fmt::format("internal error: {}; please report it", e.what()));
  }
}

/// --help and --version arrive as exceptions.
void PrintHelp(const CLI::App& app, const CLI::Success& request) {
  std::ostringstream out, err;
  app.exit(request, out, err);
  oted::cli::PrintText(out.str());
}

void AddVerbs(oted::cli::Program& program) {
  using namespace oted::cli;
  const auto group = [&](const char* title, std::initializer_list<void (*)(Program&)> verbs) {
    for (const auto add : verbs) add(program);
    for (CLI::App* verb : program.app.get_subcommands([](const CLI::App*) { return true; })) {
      if (verb->get_group() == "Subcommands") verb->group(title);
    }
  };
  group("Before a design", {AddInitVerb, AddDataVerb, AddParamsVerb, AddSchemaVerb, AddCompletionVerb});
  group("The stages", {AddStageVerbs, AddEvaluateVerb, AddReportVerb});
  group("After a design", {AddValidateVerb, AddExportVerb, AddVerifyVerb});
  group("Studies", {AddBehaviorVerb, AddCollectVerb, AddReproduceVerb, AddPlanVerb, AddSweepVerb, AddSubmitVerb,
                    AddUnitVerb, AddMergeVerb});
}

}  // namespace

int oted::cli::RunWords(const std::vector<std::string>& words) {
  Program program;
  program.command_line = "oted";
  for (const std::string& word : words) program.command_line += " " + word;
  program.app.require_subcommand(1);
  AddVerbs(program);
  // CLI11 takes them from the end.
  program.app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
  return program.exit_code;
}

int oted::cli::Main(int argc, char** argv) {
  PrepareStreams();
  cli::InstallStopHandler();
  cli::Program program;
  program.app.set_version_flag("--version", "oted " OTED_VERSION);
  program.app.require_subcommand(1);
  AddVerbs(program);
  try {
    const std::span<char*> words = std::span(argv, static_cast<size_t>(argc)).subspan(1);
    CheckWords(words);
    program.command_line = cli::CommandLine(argc, argv);
    CheckVerbs(program.app, words);
    try {
      program.app.parse(argc, argv);
    } catch (const CLI::Success& request) {
      PrintHelp(program.app, request);
    }
    FinishOutput();
    return program.exit_code;
  } catch (...) {
    return FailOfException(program.app);
  }
}
