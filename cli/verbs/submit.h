#pragma once
/// oted submit PLAN --engine local|slurm: runs what is missing of a plan, and merges.

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "cli/program.h"
#include "cli/verbs/merge.h"
#include "cli/verbs/plan.h"

namespace oted::cli {

void AddSubmitVerb(Program& program);

/// What runs a plan's units.
enum class Engine { kLocal, kSlurm };

struct SubmitOptions {
  std::optional<Engine> engine;
  int at_once = 0, rounds = 3;
  bool retry_failed = false, quiet = false;
  std::vector<std::string> sbatch;
  MergeOptions merge;
};
/// @param engine_required  false: nothing is submitted where none is given
void AddSubmitOptions(CLI::App& verb, SubmitOptions& options, bool engine_required);
/// @return the exit code
int SubmitPlan(const PlanPlace& place, SubmitOptions options);

}  // namespace oted::cli
