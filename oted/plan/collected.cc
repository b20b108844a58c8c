#include "oted/plan/collected.h"

#include <fmt/format.h>

#include "oted/base/error.h"

namespace oted {
namespace {

void CheckBelongs(const PlanLine& line, const UnitRecord& record, const std::string& where) {
  if (record.key != line.key) {
    throw DataError(fmt::format("'{}' holds the unit {} and {} was wanted; remove it, and its unit is missing again",
                                where, record.key, line.key));
  }
  if (record.version != OTED_VERSION) {
    throw DataError(fmt::format("'{}' was made by oted {} and this is {}; merge with the version of the plan", where,
                                record.version, OTED_VERSION));
  }
}

}  // namespace

Collected Collect(const Plan& plan, const WorkRoot& root, bool mixed) {
  Collected result;
  const std::set<std::string> done = root.Done(), failed = root.Failed();
  for (const PlanLine& line : plan.lines) {
    const std::string unit = line.Folder();
    if (done.contains(unit)) {
      CollectedUnit found{line, root.ReadDone(unit), root.Result(unit)};
      CheckBelongs(line, found.record, found.folder.string());
      result.done.push_back(std::move(found));
    } else if (failed.contains(unit)) {
      CollectedUnit found{line, root.ReadFailed(unit), root.FailedFile(unit)};
      CheckBelongs(line, found.record, found.folder.string());
      result.failed.push_back(std::move(found));
    } else {
      result.missing.push_back(line);
    }
  }
  for (const CollectedUnit& unit : result.done) {
    const UnitPlace &place = unit.record.place, &first = result.done.front().record.place;
    if (mixed || place.instruction_set == first.instruction_set) continue;
    throw DataError(
        fmt::format("'{}' was made with {} on {} and '{}' with {} on {}: their bytes need not agree; run the units on "
                    "one kind of processor, or merge with --mixed",
                    result.done.front().line.name, first.instruction_set, first.host, unit.line.name,
                    place.instruction_set, place.host));
  }
  return result;
}

}  // namespace oted
