#pragma once
/// Plans of units that do nothing but count themselves. Include from *_test.cc files only.

#include <fmt/format.h>

#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "oted/base/files.h"
#include "oted/plan/unit.h"

namespace oted {

inline PlanLine CountedLine(int i) {
  PlanLine line;
  line.key = UnitKey(i);
  line.name = fmt::format("unit {}", i);
  return line;
}

inline Plan CountedPlan(int n) {
  Plan plan;
  for (int i = 0; i < n; ++i) plan.lines.push_back(CountedLine(i));
  return plan;
}

/// A process on a machine that cannot be seen from here.
inline UnitOwner OwnerElsewhere(int pid) { return {fmt::format("node{}", pid), "another boot", pid, 1}; }

/// The machine is gone: nothing of the process runs any more, not even what would clean up.
struct NodeDies : std::runtime_error {
  NodeDies() : std::runtime_error("the node died") {}
};

inline UnitTry Ends(int exit_code, const std::string& message = "") {
  return {.exit_code = exit_code, .message = message, .seconds = 1};
}

}  // namespace oted
