// oted report: the page and its JSON, from what a run directory holds.

#include "oted/report/report.h"

#include <fmt/format.h>

#include <memory>

#include "cli/options.h"
#include "cli/verbs.h"

namespace oted::cli {

void AddReportVerb(Program& program) {
  CLI::App* verb =
      program.app.add_subcommand("report", "write report.html and report.json from what a run directory holds");
  auto options = std::make_shared<Options>();
  verb->add_option("--out", options->out, "run directory")->required();
  verb->add_flag("--json", options->json, "print the result as JSON");
  verb->callback([&program, options] {
    WriteReport(options->out);
    program.exit_code = PrintResult(options->out, *options);
  });
}

}  // namespace oted::cli
