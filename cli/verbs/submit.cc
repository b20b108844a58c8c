#include "cli/verbs/submit.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>

#include "cli/console.h"
#include "cli/numbers.h"
#include "cli/session.h"
#include "cli/stop.h"
#include "cli/terminal.h"
#include "cli/verbs/merge.h"
#include "cli/verbs/plan.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/parallel.h"
#include "oted/plan/child_program.h"
#include "oted/plan/local_engine.h"
#include "oted/plan/slurm.h"

namespace oted::cli {
namespace {

namespace fs = std::filesystem;

int SubmitLocal(const Plan& plan, const PlanPlace& place, const SubmitOptions& options) {
  WaitForChildrenOnStop();
  const WorkRoot root(place.root);
  const int threads = plan.MostNeeds().threads;
  TerminalSink terminal(options.quiet);
  LocalEngine engine;
  engine.at_once = options.at_once > 0 ? options.at_once : std::max(1, AvailableThreads() / threads);
  engine.words = [&](int index) -> std::vector<std::string> {
    return {ThisProgram().string(), "unit",    place.file.string(),  "--out",
            place.root.string(),    "--index", std::to_string(index)};
  };
  engine.log = [&](int index) { return place.root / "logs" / fmt::format("{}.log", index); };
  engine.look = [&] {
    const PlanState state = StateOf(plan, root);
    const auto left = state.SecondsLeft();
    terminal.Progress(
        "units", place.root.filename().string(), state.Count(UnitState::kDone),
        static_cast<int64_t>(state.units.size()),
        fmt::format("{} running, {} failed{}", state.Count(UnitState::kRunning), state.Count(UnitState::kFailed),
                    left ? fmt::format(", about {} left", Duration(*left)) : ""));
  };
  MakeFolders(place.root / "logs");
  for (int round = 0; round < options.rounds; ++round) {
    const std::vector<int> open = StateOf(plan, root).Open();
    if (open.empty()) break;
    RunHere(open, engine, MakeContext(terminal, 1));
  }
  return MergePlan(plan, place, options.merge);
}

/// The same command with a round less, for the job behind the arrays.
std::vector<std::string> FollowUp(const PlanPlace& place, const SubmitOptions& options) {
  std::vector<std::string> words = {ThisProgram().string(),
                                    "submit",
                                    place.file.string(),
                                    "--out",
                                    place.root.string(),
                                    "--engine",
                                    "slurm",
                                    "--rounds",
                                    std::to_string(options.rounds - 1)};
  if (options.at_once > 0) words.insert(words.end(), {"--at-once", std::to_string(options.at_once)});
  for (const std::string& word : options.sbatch) words.push_back("--sbatch=" + word);
  if (!options.merge.to.empty()) words.insert(words.end(), {"--merge-to", fs::absolute(options.merge.to).string()});
  if (options.merge.mixed) words.push_back("--mixed");
  return words;
}

int SubmitToCluster(const Plan& plan, const PlanPlace& place, const SubmitOptions& options) {
  const std::vector<std::string> queued = JobsInQueue(place.root);
  if (!queued.empty()) {
    throw UsageError(
        fmt::format("jobs {} of this plan wait or run already; wait for their end (oted plan status {} "
                    "--watch), or end them (scancel {})",
                    fmt::join(queued, ", "), place.file.string(), fmt::join(queued, " ")));
  }
  const PlanState state = StateOf(plan, WorkRoot(place.root));
  // No job is left: what seems to run was lost a moment ago.
  std::vector<int> open = state.Open();
  const std::vector<int> lost = state.In(UnitState::kRunning);
  open.insert(open.end(), lost.begin(), lost.end());
  std::ranges::sort(open);
  if (open.empty() || options.rounds == 0) return MergePlan(plan, place, options.merge);
  SlurmRequest request{.plan = place.file,
                       .root = place.root,
                       .indices = std::move(open),
                       .needs = plan.MostNeeds(),
                       .at_once = options.at_once,
                       .more = options.sbatch,
                       .follow_up = FollowUp(place, options)};
  const SlurmJobs jobs = SubmitToSlurm(request);
  Print("{} unit{} in array job{} {}; job {} submits what is then missing, and merges\n", request.indices.size(),
        request.indices.size() == 1 ? "" : "s", jobs.arrays.size() == 1 ? "" : "s", fmt::join(jobs.arrays, ", "),
        jobs.follow_up);
  return 0;
}

}  // namespace

void AddSubmitOptions(CLI::App& verb, SubmitOptions& options, bool engine_required) {
  CLI::Option* engine = verb.add_option_function<std::string>(
                                "--engine",
                                [&options](const std::string& name) {
                                  options.engine = name == "slurm" ? Engine::kSlurm : Engine::kLocal;
                                },
                                "local: this machine's cores; slurm: arrays of jobs")
                            ->check(CLI::IsMember({"local", "slurm"}));
  if (engine_required) engine->required();
  verb.add_option("--at-once", options.at_once,
                  "units at a time [default: local as many as there are cores, slurm as many as the cluster gives]")
      ->check(PositiveNumber());
  verb.add_option("--rounds", options.rounds, "how often what is then missing is submitted again, the first included")
      ->check(NonNegativeNumber())
      ->capture_default_str();
  verb.add_flag("--retry-failed", options.retry_failed, "begin failed units anew");
  verb.add_option("--sbatch", options.sbatch, "an option for sbatch, as --sbatch=--partition=long; repeatable")
      ->allow_extra_args(false);
  verb.add_flag("--quiet", options.quiet, "no progress on stderr");
  AddMergeOptions(verb, options.merge);
}

int SubmitPlan(const PlanPlace& place, SubmitOptions options) {
  const Plan plan = ReadPlan(place);
  options.merge.Stem(plan, place);  // is told before hours of work
  const WorkRoot root(place.root);
  for (const PlanLine& line : plan.lines) {
    if (options.retry_failed) root.ForgetFailure(line.Folder());
  }
  root.RemoveLeftovers();
  return options.engine == Engine::kSlurm ? SubmitToCluster(plan, place, options) : SubmitLocal(plan, place, options);
}

void AddSubmitVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand("submit", "run what is missing of a plan, here or by Slurm, and merge");
  struct Words {
    PlanPlace place;
    SubmitOptions submit;
  };
  auto words = std::make_shared<Words>();
  AddPlanPlace(*verb, words->place);
  AddSubmitOptions(*verb, words->submit, true);
  verb->callback([&program, words] {
    words->place.Resolve();
    program.exit_code = SubmitPlan(words->place, words->submit);
  });
}

}  // namespace oted::cli
