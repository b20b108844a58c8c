#pragma once
/// The units of a plan that are done, checked.

#include <filesystem>
#include <vector>

#include "oted/plan/plan.h"
#include "oted/plan/work_root.h"

namespace oted {

struct CollectedUnit {
  PlanLine line;
  UnitRecord record;
  std::filesystem::path folder;
};

struct Collected {
  std::vector<CollectedUnit> done;  ///< in the plan's order
  std::vector<PlanLine> missing;    ///< neither done nor failed
  std::vector<CollectedUnit> failed;
};

/// @param mixed  takes units of several instruction sets, whose bytes differ
/// @throws DataError where a record is damaged, or is of another unit, version or instruction set
Collected Collect(const Plan& plan, const WorkRoot& root, bool mixed);

}  // namespace oted
