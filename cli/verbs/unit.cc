#include "cli/verbs/unit.h"

#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <cstring>
#include <memory>
#include <thread>

#include "cli/console.h"
#include "cli/stop.h"
#include "cli/verbs/plan.h"
#include "cli/versions.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/nn/gemm.h"
#include "oted/plan/child_program.h"
#include "oted/plan/unit.h"
#include "oted/plan/unit_record.h"

namespace oted::cli {
namespace {

using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

constexpr std::chrono::milliseconds kPause{50};
constexpr std::chrono::seconds kBeat{15};
/// The command ends within two seconds of a signal.
constexpr std::chrono::seconds kPatience{4};

const char* InstructionSet() {
  switch (GemmKernels().front()) {
    case GemmKernel::kAvx512:
      return "avx512";
    case GemmKernel::kAvx2:
      return "avx2";
    case GemmKernel::kPortable:
      return "portable";
  }
  return "portable";
}

/// The last line that a command printed, without "oted: ".
std::string LastLine(const fs::path& log) {
  const std::string text = fs::exists(log) ? ReadFile(log) : "";
  const size_t end = text.find_last_not_of(" \n");
  if (end == std::string::npos) return "";
  const size_t begin = text.rfind('\n', end);
  std::string line =
      text.substr(begin == std::string::npos ? 0 : begin + 1, end - (begin == std::string::npos ? 0 : begin + 1) + 1);
  if (line.starts_with("oted: ")) line.erase(0, std::strlen("oted: "));
  return Printable(line);
}

std::string MessageOf(int exit_code, const fs::path& log) {
  if (EndOf(exit_code) == UnitEnd::kDone) return "";
  if (exit_code <= 128 || exit_code == static_cast<int>(ExitCode::kInterrupted)) return LastLine(log);
  if (exit_code == ChildProgram::kUnknownEnd) {
    return fmt::format("it ended and the system does not say how; its last line: {}", LastLine(log));
  }
  return fmt::format("signal {} ({}) ended it; its last line: {}", exit_code - 128, ::strsignal(exit_code - 128),
                     LastLine(log));
}

UnitTry RunCommand(const PlanLine& line, const fs::path& folder, const std::function<bool()>& beat) {
  std::vector<std::string> words = {ThisProgram().string()};
  words.insert(words.end(), line.words.begin(), line.words.end());
  words.insert(words.end(),
               {"--out", (folder / "result").string(), "--threads", std::to_string(line.needs.threads), "--quiet"});
  const fs::path log = folder / "log.txt";
  const Clock::time_point start = Clock::now();
  ChildProgram child(words, log);
  Clock::time_point last_beat = start, told{};
  std::optional<int> code;
  while (!(code = child.Poll())) {
    std::this_thread::sleep_for(kPause);
    if (Clock::now() - last_beat > kBeat) {
      last_beat = Clock::now();
      if (!beat()) return {};  // the child ends with its object
    }
    if (g_stop && told == Clock::time_point{}) {
      child.Signal(SIGTERM);
      told = Clock::now();
    }
    if (g_stop && Clock::now() - told > kPatience) break;
  }
  UnitTry end{.exit_code = code.value_or(static_cast<int>(ExitCode::kInterrupted))};
  // What a stop ended is to go on, however it ended.
  if (g_stop && EndOf(end.exit_code) != UnitEnd::kDone) end.exit_code = static_cast<int>(ExitCode::kInterrupted);
  end.message = MessageOf(end.exit_code, log);
  end.seconds = std::chrono::duration<double>(Clock::now() - start).count();
  return end;
}

/// A process on another machine that died is known to be gone only when it has been silent for a while.
UnitReport MakeWithPatience(const PlanLine& line, const WorkRoot& root, const UnitPlace& place) {
  constexpr std::chrono::seconds kLook{3};
  const Clock::time_point end = Clock::now() + kLease + kLook;
  while (true) {
    UnitReport report = MakeUnit(line, root, place, RunCommand);
    if (report.outcome != UnitOutcome::kBusy || Clock::now() > end || g_stop) return report;
    for (Clock::time_point next = Clock::now() + kLook; Clock::now() < next && !g_stop;) {
      std::this_thread::sleep_for(kPause);
    }
  }
}

int ReportOf(const PlanLine& line, const UnitReport& report, const fs::path& root) {
  switch (report.outcome) {
    case UnitOutcome::kDone:
      Say(fmt::format("{}: done\n", line.name));
      return 0;
    case UnitOutcome::kWasDone:
      Say(fmt::format("{}: was done\n", line.name));
      return 0;
    case UnitOutcome::kFailed:
      Say(fmt::format("oted: {}: {}\n", line.name, report.message));
      return report.exit_code > 128 ? static_cast<int>(ExitCode::kInternal) : report.exit_code;
    case UnitOutcome::kInterrupted:
      throw Interrupted(fmt::format("{}: {}", line.name, Interrupted::kGoOn));
    case UnitOutcome::kWasFailed:
      throw DataError(fmt::format("{} failed before: see '{}'; remove that file to try again", line.name,
                                  WorkRoot(root).FailedFile(line.Folder()).string()));
    case UnitOutcome::kBusy:
      break;
  }
  throw UsageError(fmt::format("another process works on {}; wait for its end, or stop it", line.name));
}

}  // namespace

void AddUnitVerb(Program& program) {
  CLI::App* verb = program.app.add_subcommand("unit", "run one unit of a plan, unless it is done");
  struct Words {
    PlanPlace place;
    int index = 0;
  };
  auto words = std::make_shared<Words>();
  AddPlanPlace(*verb, words->place);
  verb->add_option("--index", words->index, "which, from 0")
      ->required()
      ->check([](const std::string& text) {  // an unset variable of an engine is no unit
        const bool is_number = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
        return is_number ? "" : "got '" + text + "', wanted a number from 0 on";
      });
  verb->callback([&program, words] {
    words->place.Resolve();
    const Plan plan = ReadPlan(words->place);
    if (words->index < 0 || words->index >= static_cast<int>(plan.lines.size())) {
      throw UsageError(fmt::format("--index {}: '{}' has the units 0 to {}", words->index, words->place.file.string(),
                                   plan.lines.size() - 1));
    }
    WaitForChildrenOnStop();
    const PlanLine& line = plan.lines[static_cast<size_t>(words->index)];
    const UnitPlace place{UnitOwner::Me().host, Cpu(), InstructionSet()};
    program.exit_code = ReportOf(line, MakeWithPatience(line, WorkRoot(words->place.root), place), words->place.root);
  });
}

}  // namespace oted::cli
