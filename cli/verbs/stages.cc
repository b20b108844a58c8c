#include "cli/verbs/stages.h"

#include <functional>
#include <memory>

#include "cli/options.h"
#include "cli/result.h"
#include "cli/session.h"
#include "cli/settings_help.h"
#include "cli/verbs/export.h"
#include "oted/report/report.h"

namespace oted::cli {
namespace {

struct StageVerb {
  const char* name;
  const char* help;
  std::vector<std::string> sections;
  bool designs, trains;  ///< what the stage needs or does
  std::function<void(Pipeline&)> call;
};

void AddStageVerb(Program& program, const StageVerb& stage) {
  CLI::App* verb = program.app.add_subcommand(stage.name, stage.help);
  auto options = std::make_shared<Options>();
  AddRunOptions(*verb, *options, {.designs = stage.designs, .agents = stage.trains});
  verb->footer(SettingsHelp(stage.sections));
  verb->callback([&program, options, stage] {
    {
      Session session(*options, program.command_line);
      if (stage.trains) session.pipeline().CheckCanTrain();
      if (stage.designs) {
        session.pipeline().SelectSimulator();
        PrintDesign(options->out, *options);
      }
      stage.call(session.pipeline());
      WriteExports(options->out);
      WriteReport(options->out);
    }
    program.exit_code = PrintResult(options->out, *options);
  });
}

}  // namespace

void AddStageVerbs(Program& program) {
  AddStageVerb(
      program,
      {"clone", "stage 1: clone the behaviour in the logs", {"clone"}, false, false, &Pipeline::CloneBehavior});
  // A design is of use once it is known which seed to trust: the verb goes on to the selection.
  AddStageVerb(program, {"design",
                         "stages 2 and 3: fit q(z) for every setting and seed, and select one",
                         {"design", "selection", "report"},
                         true,
                         false,
                         &Pipeline::ReplayLogs});
  AddStageVerb(program,
               {"select-simulator",
                "stage 3: score the designs and select the best setting; the same as design, which goes on to it",
                {"selection", "report"},
                true,
                false,
                &Pipeline::ReplayLogs});
  AddStageVerb(program, {"train",
                         "stage 4: train agents in the designed simulators",
                         {"agents", "crossq", "sac", "ppo", "baselines", "f_brc", "mbop", "td3_bc", "rebrac"},
                         true,
                         true,
                         &Pipeline::TrainAgents});
  AddStageVerb(program, {"select-policy",
                         "stage 5: rank the agents in every designed simulator",
                         {"agents"},
                         true,
                         true,
                         &Pipeline::SelectPolicy});
}

}  // namespace oted::cli
