#include "cli/verbs/export.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <utility>

#include "cli/console.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/exports/export.h"
#include "oted/run/verify.h"

namespace oted::cli {

void AddExportVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand(
      "export", "write the designed model as MJCF, q(z) as JSON, and parameters for mujoco.sysid");
  struct Words {
    std::string run, mjcf, q, sysid, member = ExportRequest().member;
  };
  auto words = std::make_shared<Words>();
  verb->add_option("RUN_DIR,--out", words->run, "run directory that holds a design.json")->required();
  verb->add_option("--mjcf", words->mjcf, "write the designed model: loads in MuJoCo's viewer and in Python");
  verb->add_option(
      "--member", words->member,
      "whose mode --mjcf writes: best (the best-scoring seed), a seed, or all, one file each (NAME-SEED.xml) "
      "[default: best]");
  verb->add_option("--q", words->q, "write the selected setting's mixture q(z) (docs/schemas/oted.q.1.schema.json)");
  verb->add_option("--sysid", words->sysid, "write a parameter file of mujoco.sysid (YAML)");
  verb->footer("Without --mjcf, --q and --sysid all three are written into RUN_DIR/export/.");
  verb->callback([words, verb] {
    for (const auto& [option, value] :
         {std::pair("--mjcf", &words->mjcf), {"--q", &words->q}, {"--sysid", &words->sysid}}) {
      if (verb->count(option) > 0 && value->empty())
        throw UsageError(fmt::format("{} names no file; give one", option));
      if (*value == "-") {
        throw UsageError(fmt::format("{} got '-', wanted a file's name; exports are not printed", option));
      }
    }
    CheckRecords(words->run);
    ExportRequest request{.mjcf = words->mjcf, .q = words->q, .sysid = words->sysid};
    if (request.mjcf.empty() && request.q.empty() && request.sysid.empty()) request = DefaultExports(words->run);
    request.member = words->member;
    if (request.mjcf.empty() && request.member != ExportRequest().member) {
      throw UsageError("--member says which model --mjcf writes; add --mjcf FILE");
    }
    for (const ExportedFile& file : Export(words->run, request)) {
      Print("{}: {}\n", file.what, file.path.string());
    }
  });
}

void WriteExports(const std::filesystem::path& run_directory) {
  if (!std::filesystem::exists(run_directory / "design.json")) return;
  try {
    CheckIsWorthExporting(run_directory);
    Export(run_directory, DefaultExports(run_directory));
  } catch (const FileError&) {
    throw;
  } catch (const Error& e) {
    // The design is done and on disk: a model that MuJoCo cannot write does not make it a failure. An earlier design's
    // exports must not pass for this one's.
    RemoveExports(run_directory);
    Say(fmt::format("warning: not exported: {}\n", e.what()));
  }
}

}  // namespace oted::cli
