#include "cli/verbs/validate.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/console.h"
#include "cli/numbers.h"
#include "cli/session.h"
#include "cli/terminal.h"
#include "oted/base/error.h"
#include "oted/data/episode_choice.h"
#include "oted/run/prediction_words.h"
#include "oted/run/validation.h"

namespace oted::cli {
namespace {

void PrintHorizons(const ValidationResult& result, const std::string& model) {
  for (size_t h = 0; h < result.validation.horizons.size(); ++h) {
    const DesignRecord::Validation::Horizon& horizon = result.validation.horizons[h];
    const auto* other = result.model && h < result.model->horizons.size() ? &result.model->horizons[h] : nullptr;
    Print("{}{:<34} {:>10} {:>10} {:>10}{}\n", h > 0 ? "\n" : "", "error over " + InWords(horizon), "nominal",
          "designed", "sensors", other != nullptr ? "  " + model : "");
    for (size_t c = 0; c < horizon.channels.size(); ++c) {
      const DesignRecord::Validation::Channel& channel = horizon.channels[c];
      Print("{:<34} {:>10.2g} {:>10.2g} {:>10.2g}{}\n", InWords(channel), channel.nominal, channel.designed,
            channel.floor, other != nullptr ? fmt::format("  {:.2g}", other->channels[c].designed) : "");
    }
  }
  Print("{}", NotesOf(result.validation.horizons.front()));
  if (result.validation.longest) Print("\n{}\n", LongestInWords(result.validation));
  Print("\n{}\n", result.sentence);
  if (!result.reaches_floor) {
    Print(
        "(name these recordings in a task file: 'oted data check' finds their faults, late commands among them, and a "
        "design from them what has changed)\n");
  }
  if (!result.of_model.empty()) Print("{}\n", result.of_model);
}

}  // namespace

void AddValidateVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand(
      "validate", "predict later recordings with a finished design, beside the nominal model and the sensors' noise");
  struct Words {
    ValidationRequest request;
    std::string run;
    std::vector<std::string> more;
    int threads = -1;
    bool json = false, quiet = false;
  };
  auto words = std::make_shared<Words>();
  verb->add_option("RUN_DIR,--out", words->run, "run directory that holds a design.json")->required();
  verb->add_option("--data", words->request.data,
                   "recordings of the same task, which the design did not see: one file or several; or a task file "
                   "that names their columns")
      ->allow_extra_args(false);
  verb->add_option("LOGS", words->more, "the same");
  verb->add_option("--episodes", words->request.episodes, kEpisodeChoiceHelp);
  verb->add_option("--model", words->request.model,
                   "another MJCF or URDF of the robot, compared as it is in place of the task file's model");
  verb->add_option("--threads", words->threads,
                   "maximum number of threads; results do not depend on it [default: all processors]")
      ->check(NonNegativeNumber());
  verb->add_flag("--json", words->json, "print the result as JSON");
  verb->add_flag("--quiet", words->quiet, "no progress on stderr");
  verb->footer(
      "Exits with 4 where the design predicts no better than the nominal model, beyond chance, and the sensors do\n"
      "not explain what it leaves.");
  verb->callback([&program, words] {
    words->request.run = words->run;
    std::ranges::copy(words->more, std::back_inserter(words->request.data));
    TerminalSink console(words->json || words->quiet);
    const ValidationResult result = Validate(words->request, MakeContext(console, std::max(0, words->threads)));
    if (words->json) {
      Print("{}\n", result.ToJson(words->request).dump(2));
    } else {
      for (const std::string& warning : result.warnings) console.Warning(warning);
      PrintHorizons(result, std::filesystem::path(words->request.model).filename().string());
    }
    const bool useful = result.predicts_better || result.reaches_floor;
    program.exit_code = static_cast<int>(useful ? ExitCode::kDone : ExitCode::kNoSimulatorMatches);
  });
}

}  // namespace oted::cli
