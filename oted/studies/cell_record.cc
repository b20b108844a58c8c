#include "oted/studies/cell_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "oted/base/error.h"

namespace oted {

using nlohmann::json;

CellRecord::CellRecord(json identity, const std::string& schema, StudyFile file, std::string cell, std::string command)
    : record_(file.Find(cell)), file_(std::move(file)), cell_(std::move(cell)), command_(std::move(command)) {
  if (record_.is_null()) {
    record_ = std::move(identity);
    record_.update({{"schema", schema}, {"version", OTED_VERSION}, {"command", command_}, {"seeds", json::array()}});
    return;
  }
  for (const auto& [name, value] : identity.items()) {
    if (record_.value(name, json()) == value) continue;
    throw UsageError(
        fmt::format("'{}' holds seeds of {} with {} = {} and this study has {}; take another "
                    "--out",
                    file_.path().string(), cell_, name, record_.value(name, json()).dump(), value.dump()));
  }
}

bool CellRecord::Has(int64_t seed) const {
  return std::ranges::any_of(record_.at("seeds"), [&](const json& entry) { return entry.at("seed") == seed; });
}

void CellRecord::Add(int64_t seed, json entry) {
  entry["seed"] = seed;
  json& seeds = record_["seeds"];
  const auto after = std::ranges::find_if(seeds, [&](const json& other) { return other.at("seed") > seed; });
  seeds.insert(after, std::move(entry));
  record_["command"] = command_;
  file_.Put(cell_, record_);
}

}  // namespace oted
