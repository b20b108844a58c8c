#pragma once
/// oted merge PLAN: the results of a plan's units as one.

#include <CLI/CLI.hpp>
#include <filesystem>

#include "cli/program.h"
#include "cli/verbs/plan.h"

namespace oted::cli {

void AddMergeVerb(Program& program);

struct MergeOptions {
  std::filesystem::path to;
  bool mixed = false;
  /// The result's place without its ending. @throws UsageError for the ending of something else
  std::filesystem::path Stem(const Plan& plan, const PlanPlace& place) const;
};
void AddMergeOptions(CLI::App& verb, MergeOptions& options);
/// Joins what is done, prints its table, and on stderr what is missing or failed. @return the exit code
int MergePlan(const Plan& plan, const PlanPlace& place, const MergeOptions& options);

}  // namespace oted::cli
