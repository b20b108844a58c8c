#pragma once
/// oted plan: work as units that any number of machines can share; and how far they are.

#include <CLI/CLI.hpp>
#include <filesystem>

#include "cli/program.h"
#include "oted/plan/plan.h"

namespace oted::cli {

void AddPlanVerb(Program& program);

/// Where a plan is written, and what its units ask for.
struct PlanTarget {
  std::filesystem::path file;
  UnitNeeds needs;
};
void AddPlanTarget(CLI::App& verb, PlanTarget& target);
/// Writes the plan and says what may follow.
void WritePlan(const Plan& plan, const PlanTarget& target);

/// A plan and the folder of its units.
struct PlanPlace {
  std::filesystem::path file, root;
  /// As absolute paths; the root is the file's name without .jsonl where none is given.
  void Resolve();
};
void AddPlanPlace(CLI::App& verb, PlanPlace& place);
/// @throws UsageError for a plan of another version of the program, whose units have other keys
Plan ReadPlan(const PlanPlace& place);

}  // namespace oted::cli
