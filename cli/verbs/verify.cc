#include "cli/verbs/verify.h"

#include <array>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/console.h"
#include "oted/base/error.h"
#include "oted/run/verify.h"

namespace oted::cli {
namespace {

const char* NameOf(FileState state) {
  static constexpr std::array<const char*, 5> kNames = {"whole", "damaged", "missing", "unproven", "left over"};
  return kNames[static_cast<size_t>(state)];
}

void PrintVerification(const Verification& found) {
  std::map<FileState, int> counts;
  std::string unproven;
  for (const VerifiedFile& file : found.files) {
    ++counts[file.state];
    if (file.state == FileState::kUnproven) unproven += (unproven.empty() ? "" : ", ") + file.path.string();
    if (file.state == FileState::kWhole || file.state == FileState::kUnproven) continue;
    Print("{:<10} {}: {}\n", NameOf(file.state), file.path.string(), Printable(file.note));
  }
  std::string text;
  for (const auto& [state, n] : counts) {
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n, NameOf(state));
    if (state == FileState::kUnproven) text += fmt::format(" ({})", Printable(unproven));
  }
  Print("{}{}\n", text, found.in_use ? "; a program works there now" : "");
}

void PrintJson(const Verification& found) {
  nlohmann::json files = nlohmann::json::array();
  for (const VerifiedFile& file : found.files) {
    files.push_back({{"path", file.path.string()}, {"state", NameOf(file.state)}, {"note", Printable(file.note)}});
  }
  const nlohmann::json record = {
      {"schema", "oted.verification/1"}, {"whole", found.is_whole()}, {"in_use", found.in_use}, {"files", files}};
  Print("{}\n", record.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace

void AddVerifyVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand(
      "verify", "say which files of a run directory are as they were written; exit with 3 when one is not");
  struct Words {
    std::string run;
    bool json = false;
  };
  auto words = std::make_shared<Words>();
  verb->add_option("RUN_DIR,--out", words->run, "run directory; it is only read")->required();
  verb->add_flag("--json", words->json, "print every file as JSON");
  verb->footer(
      "Each stage's record holds the SHA-256 of its files and of the records that it was made from.\nUnproven are "
      "files "
      "that no record speaks for: what is still being made, event files, the report and the exports.");
  verb->callback([&program, words] {
    const Verification found = VerifyRun(words->run);
    if (words->json) {
      PrintJson(found);
    } else {
      PrintVerification(found);
    }
    program.exit_code = static_cast<int>(found.is_whole() ? ExitCode::kDone : ExitCode::kDataOrModel);
  });
}

}  // namespace oted::cli
