#pragma once
/// The program's verbs. Each adds its subcommand; its callback does the work and stores the exit code.

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace oted::cli {

struct Program {
  CLI::App app{"oted fits your simulator to your logs, then trains in it."};
  std::string command_line;
  int exit_code = 0;
};

/// Runs a command within this one, as its words are. @return its exit code
int RunWords(const std::vector<std::string>& words);

void AddRunVerb(Program& program);
void AddStageVerbs(Program& program);
void AddEvaluateVerb(Program& program);
void AddCollectVerb(Program& program);
void AddBehaviorVerb(Program& program);
void AddParamsVerb(Program& program);
void AddReportVerb(Program& program);
void AddVerifyVerb(Program& program);
void AddDataVerb(Program& program);
void AddExportVerb(Program& program);
void AddReproduceVerb(Program& program);
/// The same studies as plans: subcommands of `plan`.
void AddStudyPlans(Program& program, CLI::App& plan);
void AddPlanVerb(Program& program);
void AddSweepVerb(Program& program);
void AddUnitVerb(Program& program);
void AddSubmitVerb(Program& program);
void AddMergeVerb(Program& program);
void AddValidateVerb(Program& program);
void AddInitVerb(Program& program);
void AddSchemaVerb(Program& program);
void AddCompletionVerb(Program& program);

}  // namespace oted::cli
