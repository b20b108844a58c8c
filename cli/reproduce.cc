// oted reproduce table2 | figure2: the paper's studies of the design, one cell after the other, each left as a file.

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/options.h"
#include "cli/verbs.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/design_study.h"
#include "oted/report/file_sink.h"
#include "oted/report/report.h"

namespace oted::cli {
namespace {

struct ReproduceOptions {
  std::string what, out, data_folder, form;
  std::vector<std::string> tasks, datasets, parameters, assignments;
  int n_seeds = 0, threads = 0;
  int64_t seed = 1;
  bool quiet = false;
};

DesignStudy StudyOf(const ReproduceOptions& options) {
  DesignStudy study = DesignStudy::Named(options.what);
  if (!options.tasks.empty()) study.tasks = options.tasks;
  if (!options.datasets.empty()) study.datasets = options.datasets;
  if (!options.parameters.empty()) study.parameters = options.parameters;
  if (!options.data_folder.empty()) study.data_folder = options.data_folder;
  if (!options.form.empty()) study.form = options.form;
  if (options.n_seeds > 0) study.n_seeds = options.n_seeds;
  study.assignments = options.assignments;
  study.seed = options.seed;
  study.threads = options.threads;
  return study;
}

void RunCell(const DesignStudy& study, const StudyCell& cell, const ReproduceOptions& options,
             const std::string& command_line, const std::filesystem::path& file) {
  const std::filesystem::path folder = std::filesystem::path(options.out) / "runs" / cell.Name();
  const auto start = std::chrono::steady_clock::now();
  {
    TerminalSink terminal(options.quiet);
    FileSink log(folder, &terminal);
    Pipeline pipeline(study.ConfigOf(cell), folder, MakeContext(log, study.threads));
    pipeline.SelectSimulator();
  }
  WriteReport(folder);
  nlohmann::json record = ScoreCell(cell, ReadJson(folder / "design.json"));
  record["seed"] = study.seed;
  record["seconds"] = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  record["command"] = command_line;
  record["version"] = OTED_VERSION;
  WriteJson(file, record);
}

}  // namespace

void AddReproduceVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand(
      "reproduce", "the paper's studies of the design, cell by cell: table2 (selection), figure2 (errors)");
  auto options = std::make_shared<ReproduceOptions>();
  verb->add_option("STUDY", options->what, "table2 or figure2")->required();
  verb->add_option("--out", options->out, "folder: one JSON per cell, its run below runs/; finished cells are kept")
      ->required();
  verb->add_option("--task", options->tasks, "halfcheetah, hopper, walker2d [default: all]");
  verb->add_option("--dataset", options->datasets, "medium, medium-expert, expert [default: all]");
  verb->add_option("--parameters", options->parameters,
                   "friction, gain, gravity, all [default: all for table2, each of them for figure2]");
  verb->add_option("--form", options->form, "design.form of every cell [default: paper]");
  verb->add_option("--seeds", options->n_seeds, "designs per setting [default: 3 for table2, 5 for figure2]")
      ->check(CLI::PositiveNumber);
  verb->add_option("--data", options->data_folder, "folder with TASK-DATASET.hdf5 [default: examples/data]");
  verb->add_option("--seed", options->seed, "names every random stream [default: 1]");
  verb->add_option("--threads", options->threads, "threads at most [default: all processors]");
  verb->add_option("--set", options->assignments, "section.key=value, any setting, for every cell; repeatable")
      ->allow_extra_args(false);
  verb->add_flag("--quiet", options->quiet, "no progress on stderr");
  verb->callback([&program, options] {
    const DesignStudy study = StudyOf(*options);
    std::vector<nlohmann::json> records;
    for (const StudyCell& cell : study.Cells()) {
      const std::filesystem::path file = std::filesystem::path(options->out) / (cell.Name() + ".json");
      if (!std::filesystem::exists(file)) RunCell(study, cell, *options, program.command_line, file);
      records.push_back(ReadJson(file));
    }
    fmt::print("{}", options->what == "table2" ? Table2(records) : Figure2(records));
  });
}

}  // namespace oted::cli
