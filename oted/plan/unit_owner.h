#pragma once
/// Which process works on a unit, as others can know it.

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace oted {

struct UnitOwner {
  std::string host;
  std::string space;  ///< of process numbers: one boot of one system, or one container in it
  int pid = 0;
  uint64_t started = 0;  ///< [ticks since boot]: tells processes of one number apart

  /// This process.
  static UnitOwner Me();
  /// Whether it surely runs no more. False where it cannot be seen from here.
  bool IsGone() const;

  nlohmann::json ToJson() const;
  /// Nobody where `record` is no owner.
  static UnitOwner FromJson(const nlohmann::json& record);
};

}  // namespace oted
