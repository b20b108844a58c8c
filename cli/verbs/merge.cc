#include "cli/verbs/merge.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <set>

#include "cli/console.h"
#include "cli/plan_state.h"
#include "cli/program.h"
#include "cli/verbs/plan.h"
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

/// The first of them on lines of their own, and how many more there are.
template <class Units, class Line>
void SayEach(const char* what, const Units& units, const Line& line) {
  for (size_t i = 0; i < std::min(units.size(), kMostNamed); ++i) Say(fmt::format("{}: {}\n", what, line(units[i])));
  if (units.size() > kMostNamed) Say(fmt::format("{}: ... and {} more\n", what, units.size() - kMostNamed));
}

void SayWhatLacks(const Collected& units) {
  SayEach("missing", units.missing, [](const PlanLine& line) { return line.name; });
  SayEach("failed", units.failed, [](const CollectedUnit& unit) {
    return fmt::format("{}: exit code {}: {}", unit.line.name, unit.record.exit_code, Printable(unit.record.message));
  });
}

/// What the user may do about it.
std::string Remedy(const Collected& units, const PlanPlace& place) {
  const std::string submit = fmt::format("'oted submit {} --engine local' (or slurm)", place.file.string());
  if (units.failed.empty()) return submit + " goes on";
  if (units.missing.empty()) return fmt::format("{} with --retry-failed tries the failed ones again", submit);
  return submit + " goes on, and with --retry-failed tries the failed ones again";
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
        fmt::format("--merge-to {}: the result of a {} is a {} file; wanted a name with that ending, or with none",
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
    Say(fmt::format("{} of {} units are done; {}\n", units.done.size(), plan.lines.size(), Remedy(units, place)));
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
