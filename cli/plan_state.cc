#include "cli/plan_state.h"

#include <fmt/format.h>

#include "cli/versions.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/report/live_page.h"

namespace oted::cli {
namespace {

struct Named {
  std::string name, what;
};

std::string NameOfUnit(const Plan& plan, int index) {
  return fmt::format("{} (index {})", plan.lines[static_cast<size_t>(index)].name, index);
}

std::vector<Named> FailedUnits(const Plan& plan, const PlanState& state, const WorkRoot& root) {
  std::vector<Named> units;
  for (const int i : state.In(UnitState::kFailed)) {
    std::string why;
    try {
      const UnitRecord record = root.ReadFailed(plan.lines[static_cast<size_t>(i)].Folder());
      why = fmt::format("exit code {}: {}", record.exit_code, record.message);
    } catch (const Error& e) {
      why = e.what();
    }
    units.push_back({NameOfUnit(plan, i), Printable(why)});
  }
  return units;
}

std::vector<Named> BegunUnits(const Plan& plan, const PlanState& state, UnitState which) {
  std::vector<Named> units;
  for (const int i : state.In(which)) {
    const BegunUnit& begun = *state.begun[static_cast<size_t>(i)];
    units.push_back({NameOfUnit(plan, i),
                     fmt::format("{}, last sign of life {} ago", begun.owner.host.empty() ? "?" : begun.owner.host,
                                 Duration(begun.silent_s))});
  }
  return units;
}

std::string Counts(const PlanState& state) {
  const auto left = state.SecondsLeft();
  return fmt::format("{} of {} done, {} running, {} stopped, {} failed, {} missing{}", state.Count(UnitState::kDone),
                     state.units.size(), state.Count(UnitState::kRunning), state.Count(UnitState::kStopped),
                     state.Count(UnitState::kFailed), state.Count(UnitState::kMissing),
                     left ? fmt::format("; about {} left", Duration(*left)) : "");
}

std::string List(const char* title, const std::vector<Named>& units) {
  if (units.empty()) return "";
  std::string text = fmt::format("{}:\n", title);
  for (size_t i = 0; i < std::min(units.size(), kMostNamed); ++i) {
    text += fmt::format("  {}: {}\n", units[i].name, units[i].what);
  }
  if (units.size() > kMostNamed) text += fmt::format("  ... and {} more\n", units.size() - kMostNamed);
  return text;
}

LivePage::Table TableOf(const char* title, const std::vector<Named>& units) {
  LivePage::Table table{title, {"unit", ""}, {}};
  for (const Named& unit : units) table.rows.push_back({unit.name, unit.what});
  return table;
}

}  // namespace

std::string StateText(const Plan& plan, const PlanState& state, const WorkRoot& root, const std::string& name) {
  return fmt::format("{}: {}\n", name, Counts(state)) + List("running", BegunUnits(plan, state, UnitState::kRunning)) +
         List("stopped", BegunUnits(plan, state, UnitState::kStopped)) + List("failed", FailedUnits(plan, state, root));
}

void WriteStatePage(const Plan& plan, const PlanState& state, const WorkRoot& root, const std::filesystem::path& file) {
  LivePage page{.title = root.path().filename().string(),
                .headline = fmt::format("{} of {} done", state.Count(UnitState::kDone), state.units.size())};
  page.text = {fmt::format("{}. As of {}.", Counts(state), Now())};
  for (const UnitState kind : {UnitState::kDone, UnitState::kRunning, UnitState::kFailed, UnitState::kStopped}) {
    page.parts.emplace_back(NameOf(UnitStateNames(), kind),
                            static_cast<double>(state.Count(kind)) / static_cast<double>(state.units.size()));
  }
  page.tables = {TableOf("Failed", FailedUnits(plan, state, root)),
                 TableOf("Running", BegunUnits(plan, state, UnitState::kRunning)),
                 TableOf("Stopped", BegunUnits(plan, state, UnitState::kStopped))};
  WriteFileAtomically(file, page.Html());
}

}  // namespace oted::cli
