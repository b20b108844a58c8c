#include "cli/verbs/report.h"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "cli/options.h"
#include "cli/result.h"
#include "oted/base/seal.h"
#include "oted/report/report.h"
#include "oted/run/verify.h"

namespace oted::cli {

void AddReportVerb(Program& program) {
  CLI::App* verb =
      program.app.add_subcommand("report", "write report.html and report.json from what a run directory holds");
  auto options = std::make_shared<Options>();
  auto folder = std::make_shared<std::string>();
  verb->add_option("RUN_DIR,--out", options->out, "run directory")->required();
  verb->add_option("--to", *folder, "folder for report.html and report.json [default: the run directory]");
  verb->add_flag("--json", options->json, "print the result as JSON");
  verb->callback([&program, options, folder] {
    CheckRecords(options->out);
    const std::string& to = folder->empty() ? options->out : *folder;
    WriteReport(options->out, to);
    const std::filesystem::path design = std::filesystem::path(options->out) / "design.json";
    if (std::filesystem::exists(design)) {
      PrintDesign(DesignRecord::FromJson(ReadSealed(design, true), design.string()), *options);
    }
    program.exit_code = PrintResult(options->out, *options, to);
  });
}

}  // namespace oted::cli
