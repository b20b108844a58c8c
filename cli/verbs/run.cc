#include "cli/verbs/run.h"

#include <memory>

#include "cli/options.h"
#include "cli/result.h"
#include "cli/session.h"
#include "cli/settings_help.h"
#include "cli/verbs/export.h"
#include "oted/report/report.h"

namespace oted::cli {

void AddRunVerb(Program& program) {
  CLI::App* verb =
      program.app.add_subcommand("run", "run all stages: clone, design, select, train, select, evaluate, report");
  auto options = std::make_shared<Options>();
  AddRunOptions(*verb, *options);
  verb->footer(SettingsHelp());
  verb->callback([&program, options] {
    {
      Session session(*options, program.command_line);
      // The answer does not wait for films and agents.
      session.pipeline().SelectSimulator();
      PrintDesign(options->out, *options);
      session.pipeline().Run();
      WriteExports(options->out);
      WriteReport(options->out);
    }
    program.exit_code = PrintResult(options->out, *options);
  });
}

}  // namespace oted::cli
