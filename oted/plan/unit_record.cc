#include "oted/plan/unit_record.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace oted {

using nlohmann::json;

json UnitRecord::ToJson() const {
  return {{"schema", kSchema},  {"key", key},           {"name", name},      {"exit_code", exit_code},
          {"message", message}, {"host", place.host},   {"cpu", place.cpu},  {"instruction_set", place.instruction_set},
          {"version", version}, {"attempts", attempts}, {"seconds", seconds}};
}

UnitRecord UnitRecord::FromJson(const json& record, const std::string& where) {
  try {
    if (record.at("schema") != kSchema)
      throw DataError(fmt::format("'{}' is no record of a unit ({})", where, kSchema));
    UnitRecord unit;
    unit.key = record.at("key");
    unit.name = record.at("name");
    unit.exit_code = record.at("exit_code");
    unit.message = record.at("message");
    unit.place = {record.at("host"), record.at("cpu"), record.at("instruction_set")};
    unit.version = record.at("version");
    unit.attempts = record.at("attempts");
    unit.seconds = record.at("seconds");
    return unit;
  } catch (const json::exception& e) {
    throw DataError(
        fmt::format("'{}' cannot be read ({}); remove its folder, and its unit is missing again", where, e.what()));
  }
}

UnitEnd EndOf(int exit_code) {
  switch (static_cast<ExitCode>(exit_code)) {
    case ExitCode::kDone:
    case ExitCode::kNoSimulatorMatches:
      return UnitEnd::kDone;
    case ExitCode::kUsage:
    case ExitCode::kDataOrModel:
      return UnitEnd::kWrong;
    case ExitCode::kInterrupted:
      return UnitEnd::kInterrupted;
    default:
      return UnitEnd::kBroken;
  }
}

}  // namespace oted
