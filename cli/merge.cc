// oted merge PLAN: the results of a plan's units as one.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>
#include <set>

#include "cli/console.h"
#include "cli/options.h"
#include "cli/plan_options.h"
#include "cli/verbs.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/plan/child_program.h"
#include "oted/plan/collected.h"
#include "oted/studies/study_join.h"
#include "oted/studies/sweep.h"

namespace oted::cli {
namespace {

namespace fs = std::filesystem;

const char* EndingOf(PlanKind kind) { return kind == PlanKind::kStudy ? ".jsonl" : ".csv"; }

void MergeStudy(const Plan& plan, const Collected& units, const fs::path& to) {
  std::vector<StudyFile> parts;
  for (const CollectedUnit& unit : units.done) parts.emplace_back(unit.folder / "result");
  std::vector<std::string> words = plan.command;
  // Another reader has other folders.
  words.insert(words.end(), {"--out", to.filename().string()});
  JoinStudies(parts, StudyFile(to), "oted " + ShellLine(words));
  words = plan.command;
  words.insert(words.end(), {"--out", to.string(), "--table"});
  RunWords(words);
}

void MergeSweep(const Collected& units, const fs::path& to) {
  const SweepTable table = SweepTable::Of(units.done);
  fs::path file = to;
  WriteFileAtomically(file += EndingOf(PlanKind::kSweep), table.Csv());
  Print("{}", table.Text());
}

void SayWhatLacks(const Collected& units) {
  for (const PlanLine& line : units.missing) Say(fmt::format("missing: {}\n", line.name));
  for (const CollectedUnit& unit : units.failed) {
    Say(fmt::format("failed: {}: exit code {}: {}\n", unit.line.name, unit.record.exit_code,
                    Printable(unit.record.message)));
  }
}

void SayWhere(const Collected& units, const fs::path& merged) {
  std::set<std::string> sets, hosts;
  for (const CollectedUnit& unit : units.done) {
    sets.insert(unit.record.place.instruction_set);
    hosts.insert(unit.record.place.host);
  }
  if (units.done.empty()) return;
  Say(fmt::format("{} units, made with {} on {}, merged into {}\n", units.done.size(), fmt::join(sets, ", "),
                  fmt::join(hosts, ", "), merged.string()));
}

}  // namespace

void AddMergeOptions(CLI::App& verb, MergeOptions& options) {
  verb.add_option("--merge-to", options.to,
                  "the result's file: .jsonl for a study, .csv for a sweep; a name without an ending gets it [default: "
                  "merged in the units' folder]");
  verb.add_flag("--mixed", options.mixed,
                "take units of several instruction sets (AVX-512, AVX2): their bytes need not agree");
}

fs::path MergeOptions::Stem(const Plan& plan, const PlanPlace& place) const {
  if (to.empty()) return place.root / "merged";
  const char* ending = EndingOf(plan.kind);
  if (!to.has_filename() || (to.has_extension() && to.extension() != ending)) {
    throw UsageError(
        fmt::format("--merge-to {}: a {} is merged into a file; wanted a name that ends with {}, or one "
                    "without an ending",
                    to.string(), NameOf(PlanKindNames(), plan.kind), ending));
  }
  return fs::path(to).replace_extension();
}

int MergePlan(const Plan& plan, const PlanPlace& place, const MergeOptions& options) {
  const fs::path to = options.Stem(plan, place);
  const Collected units = Collect(plan, WorkRoot(place.root), options.mixed);
  if (!units.done.empty() && plan.kind == PlanKind::kStudy) MergeStudy(plan, units, to);
  if (!units.done.empty() && plan.kind == PlanKind::kSweep) MergeSweep(units, to);
  FinishOutput();
  SayWhere(units, to.string() + EndingOf(plan.kind));
  SayWhatLacks(units);
  const bool complete = units.missing.empty() && units.failed.empty();
  if (!complete) {
    Say(fmt::format("{} of {} units are done; 'oted submit {} --engine local' (or slurm) goes on{}\n",
                    units.done.size(), plan.lines.size(), place.file.string(),
                    units.failed.empty() ? "" : ", and with --retry-failed tries the failed ones again"));
  }
  return static_cast<int>(complete ? ExitCode::kDone : ExitCode::kDataOrModel);
}

void AddMergeVerb(Program& program) {
  CLI::App* verb =
      program.app.add_subcommand("merge", "join the results of a plan's units; exit with 3 when some are missing");
  struct Words {
    PlanPlace place;
    MergeOptions merge;
  };
  auto words = std::make_shared<Words>();
  AddPlanPlace(*verb, words->place);
  AddMergeOptions(*verb, words->merge);
  verb->callback([&program, words] {
    words->place.Resolve();
    program.exit_code = MergePlan(ReadPlan(words->place), words->place, words->merge);
  });
}

}  // namespace oted::cli
