#include "cli/verbs/reproduce.h"

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/console.h"
#include "cli/numbers.h"
#include "cli/options.h"
#include "cli/session.h"
#include "cli/value_kinds.h"
#include "cli/verbs/plan.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/report/file_sink.h"
#include "oted/report/report.h"
#include "oted/report/study_page.h"
#include "oted/studies/density_study.h"
#include "oted/studies/design_study.h"
#include "oted/studies/study_file.h"
#include "oted/studies/study_plan.h"
#include "oted/studies/table1_study.h"
#include "oted/studies/table1_text.h"

namespace oted::cli {
namespace {

/// What is done with a study.
enum class StudyUse { kRun, kPlan };

struct StudyOptions {
  std::filesystem::path out;
  std::vector<std::string> assignments;
  int threads = 0;
  bool quiet = false, table = false;
  PlanTarget plan;
};

struct DesignStudyOptions : StudyOptions {
  DesignStudy study;
  std::vector<std::string> target;
};

struct DensityStudyOptions : StudyOptions {
  DensityStudy study;
};

struct Table1Options : StudyOptions {
  Table1Study study;
  std::vector<std::string> guess;
};

nlohmann::json RunCell(const DesignStudy& study, const StudyCell& cell, const StudyOptions& options,
                       const std::string& command_line) {
  const std::filesystem::path folder = options.out / "runs" / cell.Name();
  const auto start = std::chrono::steady_clock::now();
  nlohmann::json record;
  {
    TerminalSink terminal(options.quiet);
    FileSink log(folder, &terminal);
    Pipeline pipeline(study.ConfigOf(cell), folder, MakeContext(log, study.threads));
    record = ScoreCell(study, cell, pipeline.SelectSimulator().record.ToJson());
  }
  WriteReport(folder);
  record["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  record["command"] = command_line;
  record["version"] = OTED_VERSION;
  return record;
}

/// What every study takes.
void AddStudyOptions(CLI::App& verb, StudyUse use, StudyOptions& options) {
  if (use == StudyUse::kPlan) {
    AddPlanTarget(verb, options.plan);
  } else {
    verb.add_option(
            "--out", options.out,
            "records go to OUT.jsonl, a line per cell, runs into the folder OUT; what is there is not run again")
        ->required();
    AddThreads(verb, options.threads);
    verb.add_flag("--table", options.table, "run nothing: print the table of what OUT.jsonl has");
    verb.add_flag("--quiet", options.quiet, "no progress on stderr");
  }
  verb.add_option("--set", options.assignments, "section.key=value, any setting, in every cell; repeatable")
      ->type_name(value_kind::kSetting)
      ->allow_extra_args(false);
}

/// The records that a study's file has of the named cells, in their order.
template <class Cells>
std::vector<nlohmann::json> RecordsThere(const Cells& cells, const std::filesystem::path& out) {
  const StudyFile file(out);
  if (!std::filesystem::exists(file.path())) {
    throw DataError(
        fmt::format("'{}' does not exist: no cell of the study has been run; check --out", file.path().string()));
  }
  const std::map<std::string, nlohmann::json> all = file.All();
  std::vector<nlohmann::json> records;
  for (const auto& cell : cells) {
    const auto found = all.find(cell.Name());
    if (found != all.end()) records.push_back(found->second);
  }
  return records;
}

/// What a table's cells are made of.
template <class Study>
void AddCellOptions(CLI::App& verb, Study& study) {
  verb.add_option("--task", study.tasks, "halfcheetah, hopper, walker2d")
      ->type_name(value_kind::kRobot)
      ->capture_default_str();
  verb.add_option("--dataset", study.datasets, "medium, medium-expert, expert")
      ->type_name(value_kind::kDataset)
      ->capture_default_str();
  verb.add_option("--parameters", study.parameters, "friction, gain, gravity, all")
      ->type_name(value_kind::kParameter)
      ->capture_default_str();
}

void AddDesignStudy(Program& program, CLI::App& parent, StudyUse use, const std::string& name, const char* help) {
  CLI::App* verb = parent.add_subcommand(name, help);
  auto options = std::make_shared<DesignStudyOptions>();
  options->study = DesignStudy::Named(name);
  DesignStudy& study = options->study;
  AddStudyOptions(*verb, use, *options);
  AddCellOptions(*verb, study);
  verb->add_option("--design-method", study.design_method, "design.method of every cell")
      ->type_name(value_kind::kMethod)
      ->capture_default_str();
  verb->add_option("--seeds", study.n_seeds, "designs per setting")->check(PositiveNumber())->capture_default_str();
  verb->add_option(
      "--target", options->target,
      "name=value, in multiples of nominal: where the demonstrations were made [default: friction=1 gain=1 "
      "gravity=1]");
  verb->add_option("--data", study.data_folder, "folder with TASK-DATASET.hdf5")->capture_default_str();
  verb->add_option("--seed", study.seed, "names every random stream")
      ->check(NonNegativeNumber())
      ->capture_default_str();
  verb->callback([&program, &study, use, options, name] {
    CheckReportCanBeMade();
    study.assignments = options->assignments;
    study.threads = options->threads;
    for (const std::string& assignment : options->target) SetNamedValue(study.target, "--target", assignment);
    if (use == StudyUse::kPlan) return WritePlan(PlanDesignStudy(name, study, options->plan.needs), options->plan);
    std::vector<nlohmann::json> records;
    if (options->table) records = RecordsThere(study.Cells(), options->out);
    const StudyFile file(options->out);
    for (const StudyCell& cell : options->table ? std::vector<StudyCell>() : study.Cells()) {
      nlohmann::json record = file.Find(cell.Name());
      if (!record.is_null()) {
        study.CheckIsOfThis(cell, record);
      } else {
        record = RunCell(study, cell, *options, program.command_line);
        file.Put(cell.Name(), record);
      }
      records.push_back(std::move(record));
    }
    Print("{}", name == "table2" ? Table2(records) : Figure2(records));
  });
}

void AddDensityStudy(Program& program, CLI::App& parent, StudyUse use) {
  CLI::App* verb = parent.add_subcommand(
      "figure3", "MiniGrid: errors of densities designed from images, beside maximum likelihood; writes figure3.html");
  auto options = std::make_shared<DensityStudyOptions>();
  DensityStudy& study = options->study;
  AddStudyOptions(*verb, use, *options);
  verb->add_option("--density", study.targets, "true densities")->capture_default_str();
  verb->add_option("--demonstrations", study.demonstrations, "demonstrated episodes")
      ->check(PositiveNumber())
      ->capture_default_str();
  verb->add_option("--designer", study.designers, "gaussian, categorical")->capture_default_str();
  verb->add_option("--policy", study.policy, "who demonstrates: expert or medium")->capture_default_str();
  verb->add_option("--seeds", study.n_seeds, "seeds, each with fresh demonstrations")
      ->check(PositiveNumber())
      ->capture_default_str();
  verb->add_option("--seed", study.first_seed, "the first of them")->check(NonNegativeNumber())->capture_default_str();
  verb->callback([&program, &study, use, options] {
    CheckReportCanBeMade();
    study.assignments = options->assignments;
    if (use == StudyUse::kPlan) return WritePlan(PlanDensityStudy(study, options->plan.needs), options->plan);
    TerminalSink terminal(options->quiet);
    std::vector<nlohmann::json> records;
    if (options->table) records = RecordsThere(study.Cells(), options->out);
    for (const DensityCell& cell : options->table ? std::vector<DensityCell>() : study.Cells()) {
      records.push_back(
          RunDensityCell(study, cell, options->out, program.command_line, MakeContext(terminal, options->threads)));
    }
    WriteStudyPage(Figure3Page(records), options->out / "figure3.html");
    Print("{}", Figure3(records));
  });
}

void AddTable1(Program& program, CLI::App& parent, StudyUse use) {
  CLI::App* verb = parent.add_subcommand("table1",
                                         "scores in the target of the clone, offline learners, DR, IS, BC+DR, OTED and "
                                         "of agents in the nominal simulator, beside the published ones");
  auto options = std::make_shared<Table1Options>();
  Table1Study& study = options->study;
  AddStudyOptions(*verb, use, *options);
  AddCellOptions(*verb, study);
  verb->add_option("--methods", study.methods, "bc, f_brc, mbop, td3_bc, rebrac, dr, is, bc_dr, oted, nominal")
      ->type_name(value_kind::kLearner)
      ->capture_default_str();
  verb->add_option("--design-method", study.design_method,
                   "design.method of OTED's cells; paper: Algorithm 1 from logged states")
      ->type_name(value_kind::kMethod)
      ->capture_default_str();
  verb->add_option("--algorithm", study.algorithm, "how agents learn: sac, as the paper's, or crossq")
      ->check(CLI::IsMember({"sac", "crossq"}))
      ->capture_default_str();
  verb->add_option("--steps", study.steps, "control steps of one agent")
      ->check(PositiveNumber())
      ->capture_default_str();
  verb->add_option("--seeds", study.n_seeds, "seeds of every cell: of clone, designs and agent")
      ->check(PositiveNumber())
      ->capture_default_str();
  verb->add_option("--seed", study.first_seed, "the first of them")->check(NonNegativeNumber())->capture_default_str();
  verb->add_option("--guess", options->guess,
                   "name=value: where the nominal simulator is and interval search begins [default: friction=1.67 "
                   "gain=0.77 gravity=0.83]");
  verb->add_option("--data", study.data_folder, "folder with TASK-DATASET.hdf5")->capture_default_str();
  verb->callback([&program, &study, use, options] {
    CheckReportCanBeMade();
    study.assignments = options->assignments;
    for (const std::string& assignment : options->guess) SetNamedValue(study.guess, "--guess", assignment);
    if (use == StudyUse::kPlan) return WritePlan(PlanTable1(study, options->plan.needs), options->plan);
    if (options->table) return Print("{}", Table1(study, RecordsThere(study.Cells(), options->out)));
    TerminalSink terminal(options->quiet);
    const Table1Hooks hooks{.keep_curves = [](const std::filesystem::path& folder,
                                              LogSink* inner) { return std::make_unique<FileSink>(folder, inner); },
                            .run_complete = [](const std::filesystem::path& folder) { WriteReport(folder); }};
    const std::vector<nlohmann::json> records =
        RunTable1(study, options->out, program.command_line, hooks, MakeContext(terminal, options->threads));
    Print("{}", Table1(study, records));
  });
}

void AddStudies(Program& program, CLI::App& parent, StudyUse use) {
  AddTable1(program, parent, use);
  AddDesignStudy(program, parent, use, "table2", "simulator selection: design error and regret of every score");
  AddDesignStudy(program, parent, use, "figure2", "design errors by parameter, alone and together");
  AddDensityStudy(program, parent, use);
}

}  // namespace

void AddStudyPlans(Program& program, CLI::App& plan) { AddStudies(program, plan, StudyUse::kPlan); }

void AddReproduceVerb(Program& program) {
  CLI::App* verb =
      program.app.add_subcommand("reproduce", "run the paper's studies cell by cell: table1, table2, figure2, figure3");
  verb->require_subcommand(1);
  AddStudies(program, *verb, StudyUse::kRun);
}

}  // namespace oted::cli
