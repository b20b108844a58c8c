#pragma once
/// oted reproduce table1 | table2 | figure2 | figure3: the paper's studies, one cell after the other, each left as a
/// line of the study's file.

#include "cli/program.h"

namespace oted::cli {

void AddReproduceVerb(Program& program);

/// The same studies as plans: subcommands of `plan`.
void AddStudyPlans(Program& program, CLI::App& plan);

}  // namespace oted::cli
