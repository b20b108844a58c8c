#pragma once
/// How far a plan is.

#include <optional>
#include <string>
#include <vector>

#include "oted/plan/plan.h"
#include "oted/plan/work_root.h"

namespace oted {

enum class UnitState {
  kMissing,  ///< not begun
  kStopped,  ///< begun, and nobody is at it
  kRunning,
  kDone,
  kFailed,
};
const NamedValues<UnitState>& UnitStateNames();

struct PlanState {
  std::vector<UnitState> units;                 ///< as the plan's lines
  std::vector<std::optional<BegunUnit>> begun;  ///< of those that run or stopped
  /// Seconds of a finished unit, of up to a hundred of them; none while none is finished.
  std::optional<double> mean_seconds;

  int Count(UnitState state) const;
  bool Complete() const { return Count(UnitState::kDone) == static_cast<int>(units.size()); }
  /// Indices of what can be run: missing and stopped.
  std::vector<int> Open() const;
  std::vector<int> In(UnitState state) const;
  /// Until nothing is open, with as many at once as run now; none where nothing is known or nothing runs. [s]
  std::optional<double> SecondsLeft() const;
};

/// Lists three folders and looks into those that were begun, whatever the number of units.
PlanState StateOf(const Plan& plan, const WorkRoot& root);

/// "12 s", "34 min", "5.6 h".
std::string Duration(double seconds);

}  // namespace oted
