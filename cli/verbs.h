#pragma once
/// The program's verbs. Each adds its subcommand; its callback does the work and stores the exit code.

#include <CLI/CLI.hpp>
#include <string>

namespace oted::cli {

struct Program {
  CLI::App app{"oted fits your simulator to your logs, then trains in it."};
  std::string command_line;
  int exit_code = 0;
};

void AddRunVerb(Program& program);
void AddStageVerbs(Program& program);
void AddEvaluateVerb(Program& program);
void AddCollectVerb(Program& program);
void AddBehaviorVerb(Program& program);
void AddParamsVerb(Program& program);
void AddReportVerb(Program& program);
void AddDataVerb(Program& program);
void AddExportVerb(Program& program);
void AddReproduceVerb(Program& program);

}  // namespace oted::cli
