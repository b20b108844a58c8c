#pragma once
/// Options that the commands on plans share, and what they do in common.

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>

#include "oted/plan/plan_state.h"

namespace oted::cli {

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

/// The terminal names so many units of a kind.
inline constexpr size_t kMostNamed = 20;

struct MergeOptions {
  std::filesystem::path to;
  bool mixed = false;
  /// The result's place without its ending. @throws UsageError for the ending of something else
  std::filesystem::path Stem(const Plan& plan, const PlanPlace& place) const;
};
void AddMergeOptions(CLI::App& verb, MergeOptions& options);
/// Joins what is done, prints its table, and on stderr what is missing or failed. @return the exit code
int MergePlan(const Plan& plan, const PlanPlace& place, const MergeOptions& options);

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

/// What the terminal shows of a plan's state.
std::string StateText(const Plan& plan, const PlanState& state, const WorkRoot& root, const std::string& name);
/// The same as a page.
void WriteStatePage(const Plan& plan, const PlanState& state, const WorkRoot& root, const std::filesystem::path& file);

}  // namespace oted::cli
