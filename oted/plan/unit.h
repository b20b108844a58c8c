#pragma once
/// Makes one unit of a plan, once, whoever else tries.

#include <filesystem>
#include <functional>
#include <string>

#include "oted/plan/plan.h"
#include "oted/plan/work_root.h"

namespace oted {

/// How a unit's command ended.
struct UnitTry {
  int exit_code = 0;
  std::string message = {};  ///< its one line of an error
  double seconds = 0;
};

/// Runs a unit's command with its results below `folder`, and goes on from what is there. Calls `beat` every few
/// seconds and stops the command when that gives false.
using UnitRunner = std::function<UnitTry(const PlanLine& line, const std::filesystem::path& folder,
                                         const std::function<bool()>& beat)>;

enum class UnitOutcome {
  kDone,         ///< now
  kWasDone,      ///< before, or by another process meanwhile
  kFailed,       ///< now, and it would again
  kWasFailed,    ///< before
  kInterrupted,  ///< its work so far is kept
  kBusy,         ///< another process is at it
};

struct UnitReport {
  UnitOutcome outcome = UnitOutcome::kDone;
  int exit_code = 0;
  std::string message = {};
};

/// How often a unit may break before it counts as failed: a crash need not repeat itself.
inline constexpr int kMostBreaks = 3;

/// Skips what is done or failed, goes on with what was stopped, runs again what broke. What is wrong fails when it
/// is wrong twice, in the same call. So does a unit whose input is not what the plan says. @param place  for the
/// record. @throws DataError when `root` takes no files
UnitReport MakeUnit(const PlanLine& line, const WorkRoot& root, const UnitPlace& place, const UnitRunner& run);

}  // namespace oted
