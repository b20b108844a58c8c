#include "cli/verbs/stages.h"

#include <memory>
#include <string>
#include <vector>

#include "cli/options.h"
#include "cli/result.h"
#include "cli/session.h"
#include "cli/settings_help.h"
#include "cli/stop.h"
#include "cli/verbs/export.h"
#include "oted/base/error.h"
#include "oted/report/report.h"
#include "oted/run/agents_step.h"
#include "oted/run/run_inputs.h"

namespace oted::cli {
namespace {

struct StageVerb {
  const char* name;
  const char* help;
  std::vector<std::string> sections;  ///< whose settings its help shows; all where none is named
  Makes makes;
  bool needs_reward;
  void (*call)(Pipeline&);
};

const std::vector<Design>& DesignAll(Pipeline& pipeline) {
  try {
    return pipeline.Design();
  } catch (const Interrupted&) {
    throw Interrupted(
        "interrupted; the design was not fitted yet: the same command begins the fit that was stopped anew, and what "
        "was complete before it stays");
  }
}

/// The answer does not wait for films and agents, nor what was found for what suspects it.
void DesignAndPrint(Pipeline& pipeline, const Options& options) {
  const std::string found = UnjudgedInWords(DesignAll(pipeline), options);
  try {
    const LastWords words(found);
    PrintDesign(pipeline.SelectSimulator().record, options, pipeline.config().TruthVector());
  } catch (const Interrupted&) {
    Print("{}", found);
    throw;
  }
}

void AddStageVerb(Program& program, const StageVerb& stage) {
  CLI::App* verb = program.app.add_subcommand(stage.name, stage.help);
  auto options = std::make_shared<Options>();
  AddRunOptions(*verb, *options, stage.makes);
  verb->footer(SettingsHelp(stage.sections));
  verb->callback([&program, options, stage] {
    CheckReportCanBeMade();
    if (stage.needs_reward) {  // before a run is begun
      RunConfig config = ResolveConfig(*options);
      config.task.Resolve();
      CheckHasReward(SpecOf(config.task));
    }
    {
      Session session(*options, program.command_line);
      if (stage.makes.designs) DesignAndPrint(session.pipeline(), *options);
      stage.call(session.pipeline());
      WriteExports(options->out);
      WriteReport(options->out);
    }
    program.exit_code = PrintResult(options->out, *options);
  });
}

}  // namespace

void AddStageVerbs(Program& program) {
  constexpr Makes kNoDesign{.designs = false, .agents = false}, kDesign{.designs = true, .agents = false}, kAgents{};
  const std::vector<StageVerb> stages = {
      {"run",
       "run all stages: clone, design, select, train, select, evaluate, report",
       {},
       kAgents,
       false,
       [](Pipeline& pipeline) { pipeline.Run(); }},
      {"clone",
       "stage 1: clone the behaviour in the logs",
       {"clone"},
       kNoDesign,
       false,
       [](Pipeline& pipeline) { pipeline.CloneBehavior(); }},
      // A design is of use once it is known which seed to trust: the verb goes on to the selection.
      {"design",
       "stages 2 and 3: fit q(z) for every setting and seed, and select one",
       {"design", "selection", "report"},
       kDesign,
       false,
       [](Pipeline& pipeline) { pipeline.ReplayLogs(); }},
      {"select-simulator",
       "stage 3: score the designs and select the best setting; the same as design, which goes on to it",
       {"design", "selection", "report"},
       kDesign,
       false,
       [](Pipeline& pipeline) { pipeline.ReplayLogs(); }},
      {"train",
       "stage 4: train agents in the designed simulators",
       {"agents", "crossq", "sac", "ppo", "baselines", "f_brc", "mbop", "td3_bc", "rebrac"},
       kAgents,
       true,
       [](Pipeline& pipeline) { pipeline.TrainAgents(); }},
      {"select-policy",
       "stage 5: rank the agents in every designed simulator",
       {"agents"},
       kAgents,
       true,
       [](Pipeline& pipeline) { pipeline.SelectPolicy(); }}};
  for (const StageVerb& stage : stages) AddStageVerb(program, stage);
}

}  // namespace oted::cli
