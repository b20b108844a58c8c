#include "cli/verbs/plan.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/console.h"
#include "cli/numbers.h"
#include "cli/plan_state.h"
#include "cli/stop.h"
#include "cli/verbs/reproduce.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/plan/indices.h"

namespace oted::cli {
namespace {

struct StatusOptions {
  PlanPlace place;
  std::filesystem::path page;
  bool missing = false, lines = false, json = false, watch = false;
};

void PrintJson(const Plan& plan, const PlanState& state) {
  nlohmann::json units = nlohmann::json::array();
  for (size_t i = 0; i < plan.lines.size(); ++i) {
    units.push_back({{"index", i},
                     {"key", plan.lines[i].key},
                     {"name", plan.lines[i].name},
                     {"state", NameOf(UnitStateNames(), state.units[i])}});
  }
  nlohmann::json record = {{"schema", "oted.plan_state/1"}, {"units", units}, {"seconds_left", nullptr}};
  if (const auto left = state.SecondsLeft()) record["seconds_left"] = *left;
  for (const auto& [value, name] : UnitStateNames()) record["counts"][name] = state.Count(value);
  Print("{}\n", record.dump(2));
}

void PrintOpen(const PlanState& state, bool lines) {
  if (!lines) return Print("{}\n", IndexRanges(state.Open()));
  for (const int index : state.Open()) Print("{}\n", index);
}

/// Until nothing runs and nothing is open, or Ctrl-C.
void Watch(const Plan& plan, const WorkRoot& root, const StatusOptions& options) {
  constexpr std::chrono::milliseconds kPause{100};
  constexpr int kPauses = 30;
  while (true) {
    const PlanState state = StateOf(plan, root);
    if (!options.page.empty()) WriteStatePage(plan, state, root, options.page);
    // From the top of a cleared screen, where there is one.
    Print("{}{}", ::isatty(STDOUT_FILENO) != 0 ? "\x1b[H\x1b[2J" : "",
          StateText(plan, state, root, options.place.file.string()));
    FinishOutput();
    if (state.Open().empty() && state.Count(UnitState::kRunning) == 0) return;
    for (int i = 0; i < kPauses && !g_stop; ++i) std::this_thread::sleep_for(kPause);
    if (g_stop) return;
  }
}

void AddStatus(CLI::App& parent) {
  CLI::App* verb = parent.add_subcommand("status", "say which units of a plan are done, running, failed or missing");
  auto options = std::make_shared<StatusOptions>();
  AddPlanPlace(*verb, options->place);
  verb->add_flag("--missing", options->missing, "print the indices that can be run, as 0-3,7");
  verb->add_flag("--lines", options->lines, "with --missing: one index a line");
  verb->add_flag("--json", options->json, "print every unit as JSON");
  verb->add_option("--page", options->page, "also write an HTML page; a browser reads it anew every five seconds");
  verb->add_flag("--watch", options->watch, "show it anew every three seconds until nothing is left to run");
  verb->callback([options] {
    options->place.Resolve();
    const Plan plan = ReadPlan(options->place);
    const WorkRoot root(options->place.root);
    if (options->watch) return Watch(plan, root, *options);
    const PlanState state = StateOf(plan, root);
    if (!options->page.empty()) WriteStatePage(plan, state, root, options->page);
    if (options->missing) return PrintOpen(state, options->lines);
    if (options->json) return PrintJson(plan, state);
    Print("{}", StateText(plan, state, root, options->place.file.string()));
  });
}

}  // namespace

void AddPlanTarget(CLI::App& verb, PlanTarget& target) {
  verb.add_option("--to", target.file, "the plan's file, NAME.jsonl")->required();
  verb.add_option("--threads", target.needs.threads, "threads of a unit; results do not depend on it")
      ->check(PositiveNumber())
      ->capture_default_str();
  verb.add_option("--memory", target.needs.memory_mib, "memory of a unit [MiB]")
      ->check(PositiveNumber())
      ->capture_default_str();
  verb.add_option("--minutes", target.needs.minutes,
                  "time limit of a unit, two of them to stop in; where it ends, the unit goes on")
      ->check(CLI::Range(5, 100'000))
      ->capture_default_str();
}

void WritePlan(const Plan& plan, const PlanTarget& target) {
  if (target.file.extension() != ".jsonl") {
    throw UsageError(fmt::format("--to {}: wanted a name that ends with .jsonl", target.file.string()));
  }
  WriteFileAtomically(target.file, plan.ToText());
  Print("{}: {} unit{}; 'oted submit {} --engine local' (or slurm) makes them\n", target.file.string(),
        plan.lines.size(), plan.lines.size() == 1 ? "" : "s", target.file.string());
}

void PlanPlace::Resolve() {
  file = std::filesystem::absolute(file).lexically_normal();
  if (root.empty()) root = std::filesystem::path(file).replace_extension();
  root = std::filesystem::absolute(root).lexically_normal();
  if (root == file) {
    throw UsageError(
        fmt::format("'{}' has no ending; a plan is NAME.jsonl, or name the units' folder by --out", file.string()));
  }
}

void AddPlanPlace(CLI::App& verb, PlanPlace& place) {
  verb.add_option("PLAN", place.file, "a plan's file")->required();
  verb.add_option("--out", place.root, "folder of the units, shared by all machines [default: PLAN without .jsonl]");
}

Plan ReadPlan(const PlanPlace& place) {
  if (!std::filesystem::exists(place.file)) {
    throw DataError(
        fmt::format("plan '{}' does not exist; 'oted sweep ... --to FILE.jsonl' or 'oted plan STUDY --to "
                    "FILE.jsonl' writes one",
                    place.file.string()));
  }
  Plan plan = Plan::Read(place.file);
  if (plan.version == OTED_VERSION) return plan;
  throw UsageError(fmt::format("'{}' was written by oted {} and this is {}; use that version, or write it again",
                               place.file.string(), plan.version, OTED_VERSION));
}

void AddPlanVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand(
      "plan", "write a study as units for many machines: table1, table2, figure2, figure3; status: how far they are");
  verb->require_subcommand(1);
  AddStudyPlans(program, *verb);
  AddStatus(*verb);
}

}  // namespace oted::cli
