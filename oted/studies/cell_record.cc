#include "oted/studies/cell_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {

using nlohmann::json;

CellRecord::CellRecord(json identity, const std::string& schema, std::filesystem::path file, std::string command)
    : file_(std::move(file)), command_(std::move(command)) {
  if (!std::filesystem::exists(file_)) {
    record_ = std::move(identity);
    record_.update({{"schema", schema}, {"version", OTED_VERSION}, {"command", command_}, {"seeds", json::array()}});
    return;
  }
  record_ = ReadJson(file_);
  for (const auto& [name, value] : identity.items()) {
    if (record_.value(name, json()) == value) continue;
    throw UsageError(fmt::format("'{}' holds seeds with {} = {} and this study has {}; take another --out",
                                 file_.string(), name, record_.value(name, json()).dump(), value.dump()));
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
  WriteJson(file_, record_);
}

}  // namespace oted
