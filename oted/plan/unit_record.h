#pragma once
/// What became of a unit: done.json beside its result, or failed/KEY.json.

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "oted/base/error.h"

namespace oted {

/// Where a unit ran.
struct UnitPlace {
  std::string host;
  std::string cpu;
  /// Which code multiplied: bytes of results differ between these.
  std::string instruction_set;
};

struct UnitRecord {
  static constexpr const char* kSchema = "oted.unit/1";
  std::string key, name;
  int exit_code = 0;         ///< of the command; 128 and the signal where that ended it
  std::string message = {};  ///< of the command's error; "" where there was none
  UnitPlace place = {};
  std::string version = OTED_VERSION;
  int attempts = 1;    ///< how often it was begun or gone on with
  double seconds = 0;  ///< of the last attempt

  nlohmann::json ToJson() const;
  /// @param where  the file, for errors. @throws DataError
  static UnitRecord FromJson(const nlohmann::json& record, const std::string& where);
};

/// What an end of a unit's command means for it (docs/exit_codes.md).
enum class UnitEnd {
  kDone,         ///< 0, and 4: an answer too
  kWrong,        ///< 2, 3: it ends so each time
  kInterrupted,  ///< 130: it goes on from where it stands
  kBroken,       ///< anything else, such as a crash: perhaps not each time
};
UnitEnd EndOf(int exit_code);

}  // namespace oted
