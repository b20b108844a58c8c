#include "oted/plan/unit.h"

#include <fmt/format.h>

#include <filesystem>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

/// What is wrong with a unit before it begins; "" for nothing.
std::string WrongInput(const PlanLine& line) {
  for (const PlanInput& input : line.inputs) {
    try {
      if (PlanInput::Of(input.path).sha256 != input.sha256) {
        return fmt::format("'{}' is not what it was when the plan was written; restore it, or plan again", input.path);
      }
    } catch (const Error& e) {
      return e.what();
    }
  }
  return "";
}

/// What another kind of processor began is begun anew: a result has the bytes of one kind.
void KeepToOneKind(const UnitClaim& claim, const std::string& instruction_set) {
  const std::filesystem::path begun_with = claim.folder() / "instruction_set";
  if (std::filesystem::exists(begun_with)) {
    if (ReadFile(begun_with) == instruction_set) return;
    std::filesystem::remove_all(claim.folder() / "result");
    RemoveFile(claim.folder() / "result.jsonl");
  }
  WriteFileAtomically(begun_with, instruction_set);
}

UnitRecord RecordOf(const PlanLine& line, const UnitPlace& place, const UnitClaim& claim, const UnitTry& last) {
  return {.key = line.key,
          .name = line.name,
          .exit_code = last.exit_code,
          .message = last.message,
          .place = place,
          .attempts = claim.attempts(),
          .seconds = last.seconds};
}

UnitReport Skipped(ClaimResult result) {
  switch (result) {
    case ClaimResult::kDone:
      return {UnitOutcome::kWasDone};
    case ClaimResult::kFailed:
      return {UnitOutcome::kWasFailed};
    default:
      return {UnitOutcome::kBusy};
  }
}

}  // namespace

UnitReport MakeUnit(const PlanLine& line, const WorkRoot& root, const UnitPlace& place, const UnitRunner& run) {
  auto [result, held] = root.Claim(line.Folder());
  if (!held) return Skipped(result);
  UnitClaim& claim = *held;
  const auto attempt = [&]() -> UnitTry {
    if (std::string wrong = WrongInput(line); !wrong.empty()) {
      return {static_cast<int>(ExitCode::kDataOrModel), std::move(wrong)};
    }
    KeepToOneKind(claim, place.instruction_set);
    return run(line, claim.folder(), [&] { return claim.Beat(); });
  };
  const auto fail = [&](const UnitTry& last) -> UnitReport {
    claim.Fail(RecordOf(line, place, claim, last));
    return {UnitOutcome::kFailed, last.exit_code, last.message};
  };
  bool was_wrong = false;
  while (true) {
    const UnitTry last = attempt();
    if (!claim.Beat()) return {UnitOutcome::kBusy};
    switch (EndOf(last.exit_code)) {
      case UnitEnd::kDone:
        return {claim.Publish(RecordOf(line, place, claim, last)) ? UnitOutcome::kDone : UnitOutcome::kWasDone};
      case UnitEnd::kInterrupted:
        claim.Release();
        return {UnitOutcome::kInterrupted, last.exit_code, last.message};
      case UnitEnd::kBroken:
        claim.AddBreak();
        if (claim.breaks() < kMostBreaks) continue;
        return fail(last);
      case UnitEnd::kWrong:
        // What a disk failed to read once ends like what is wrong.
        if (!std::exchange(was_wrong, true)) continue;
        return fail(last);
    }
  }
}

}  // namespace oted
