#include "oted/plan/plan_state.h"

#include <fmt/format.h>

#include <algorithm>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr size_t kSample = 100;

std::optional<double> MeanSeconds(const Plan& plan, const PlanState& state, const WorkRoot& root) {
  const std::vector<int> done = state.In(UnitState::kDone);
  const size_t stride = std::max<size_t>(1, done.size() / kSample);
  double sum = 0;
  int n = 0;
  for (size_t i = 0; i < done.size(); i += stride) {
    try {
      sum += root.ReadDone(plan.lines[static_cast<size_t>(done[i])].Folder()).seconds;
      ++n;
    } catch (const Error&) {
      // The merge names it.
    }
  }
  return n == 0 ? std::nullopt : std::optional(sum / n);
}

}  // namespace

const NamedValues<UnitState>& UnitStateNames() {
  static const NamedValues<UnitState> names = {{UnitState::kMissing, "missing"},
                                               {UnitState::kStopped, "stopped"},
                                               {UnitState::kRunning, "running"},
                                               {UnitState::kDone, "done"},
                                               {UnitState::kFailed, "failed"}};
  return names;
}

int PlanState::Count(UnitState state) const { return static_cast<int>(std::ranges::count(units, state)); }

std::vector<int> PlanState::In(UnitState state) const {
  std::vector<int> found;
  for (size_t i = 0; i < units.size(); ++i) {
    if (units[i] == state) found.push_back(static_cast<int>(i));
  }
  return found;
}

std::vector<int> PlanState::Open() const {
  std::vector<int> open = In(UnitState::kMissing);
  const std::vector<int> stopped = In(UnitState::kStopped);
  open.insert(open.end(), stopped.begin(), stopped.end());
  std::ranges::sort(open);
  return open;
}

std::optional<double> PlanState::SecondsLeft() const {
  const int running = Count(UnitState::kRunning);
  if (!mean_seconds || running == 0) return std::nullopt;
  // Those that run are half done on average.
  return *mean_seconds * (static_cast<double>(Open().size()) / running + 0.5);
}

PlanState StateOf(const Plan& plan, const WorkRoot& root) {
  // What ends between the listings is listed twice, never lost.
  const std::map<std::string, BegunUnit> begun = root.Begun();
  const std::set<std::string> failed = root.Failed(), done = root.Done();
  PlanState state;
  for (const PlanLine& line : plan.lines) {
    const std::string unit = line.Folder();
    const auto at = begun.find(unit);
    state.begun.emplace_back();
    if (done.contains(unit)) {
      state.units.push_back(UnitState::kDone);
    } else if (failed.contains(unit)) {
      state.units.push_back(UnitState::kFailed);
    } else if (at == begun.end()) {
      state.units.push_back(UnitState::kMissing);
    } else {
      state.units.push_back(at->second.runs ? UnitState::kRunning : UnitState::kStopped);
      state.begun.back() = at->second;
    }
  }
  state.mean_seconds = MeanSeconds(plan, state, root);
  return state;
}

std::string Duration(double seconds) {
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  if (seconds < 5400) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

}  // namespace oted
