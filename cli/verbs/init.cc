#include "cli/verbs/init.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/console.h"
#include "cli/numbers.h"
#include "cli/options.h"
#include "cli/session.h"
#include "cli/terminal.h"
#include "oted/plan/child_program.h"
#include "oted/proposal/task_proposal.h"

namespace oted::cli {
namespace {

void PrintLines(const char* title, const std::vector<std::string>& lines) {
  if (lines.empty()) return;
  Print("\n{}\n", title);
  for (const std::string& line : lines) Print("  {}\n", line);
}

void PrintColumns(const std::vector<ColumnMap::Entry>& entries) {
  for (const ColumnMap::Entry& entry : entries) {
    Print("  {:<28} {}{}\n", entry.column, entry.path, entry.by_order ? "  (by its number)" : "");
  }
}

void PrintProposal(const Proposal& proposal, const std::string& out) {
  Print("{:<30} {}\n", "column", "is");
  PrintColumns(proposal.columns.observations);
  PrintColumns(proposal.columns.actions);
  PrintLines("columns not used", proposal.columns.unused);
  std::vector<std::string> parameters;
  for (const ParameterSpec& spec : proposal.config.parameters) {
    parameters.push_back(fmt::format("{:<26} {}  {:g} .. {:g}{}", spec.name, spec.field, spec.low, spec.high,
                                     spec.scale == ParameterScale::kAbsolute ? "" : " x nominal"));
  }
  if (proposal.NamesActuated()) parameters.push_back(fmt::format("@actuated: {}", Proposal::kActuated));
  PrintLines("parameters to doubt", parameters);
  PrintLines("not freed", proposal.NotFreed());
  PrintLines("guessed, so check it", proposal.guessed);
  PrintLines("look at this before a design", proposal.suspicious);
  if (!proposal.suspicious.empty()) {
    Print(
        "  parameters and ranges were chosen by the columns as they are: look at them again once these are "
        "corrected\n");
  }
  const std::string word = ShellLine({out});
  Print("\n{}: read it, correct it, then\n  oted data check {}\n  oted design {} --out RUN\n", out, word, word);
}

}  // namespace

void AddInitVerb(Program& program) {
  CLI::App* verb =
      program.app.add_subcommand("init", "write a first task file from a model and logs, and say what was guessed");
  struct Words {
    ProposalRequest request;
    std::string out = "task.toml";
    int threads = -1;
    bool json = false, quiet = false;
  };
  auto words = std::make_shared<Words>();
  verb->add_option("MODEL", words->request.model, "MJCF or URDF file, or package:NAME/...")->required();
  verb->add_option(
          "LOGS", words->request.logs,
          "logged trajectories: .csv, .csv.gz, .npz, .hdf5 or a Minari folder; columns of several are named alike")
      ->required();
  verb->add_option("--out", words->out, "task file to write [default: task.toml]");
  verb->add_option("--period", words->request.control_period, "time between two rows [s], where the logs do not say")
      ->check(PositiveNumber());
  verb->add_flag("--schema", words->request.with_schema,
                 "write the schema of task files beside it, and name it in the first line: editors complete and check");
  AddThreads(*verb, words->threads);
  verb->add_flag("--json", words->json, "print the result as JSON");
  verb->add_flag("--quiet", words->quiet, "no progress on stderr");
  verb->footer(
      "Columns are matched by the names of joints, actuators and sensors: hip_pos, hip_vel, hip_cmd, q0, tau1, ...\n"
      "docs/your_own_robot.md has an example.");
  verb->callback([words] {
    words->request.out = words->out;
    TerminalSink log(words->json || words->quiet);
    const Proposal proposal = ProposeTask(words->request, MakeContext(log, std::max(0, words->threads)));
    if (words->json) {
      Print("{}\n", proposal.ToJson(words->out).dump(2));
    } else {
      PrintProposal(proposal, words->out);
    }
  });
}

}  // namespace oted::cli
