#include "oted/studies/study_join.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "oted/base/error.h"

namespace oted {
namespace {

using nlohmann::json;

/// Without what differs between two runs of the same work.
json Result(json record) {
  for (const char* name : {"seconds", "cpu_s", "command"}) record.erase(name);
  return record;
}

json Common(json record) {
  record.erase("seeds");
  return Result(std::move(record));
}

void JoinSeeds(const json& record, json& joined, const std::function<void(const std::string&)>& refuse) {
  json& seeds = joined.at("seeds");
  for (const json& entry : record.at("seeds")) {
    const auto at = std::ranges::find_if(seeds, [&](const json& e) { return e.at("seed") >= entry.at("seed"); });
    if (at == seeds.end() || at->at("seed") != entry.at("seed")) {
      seeds.insert(at, entry);
    } else if (Result(*at) != Result(entry)) {
      refuse(fmt::format("seed {}", entry.at("seed").dump()));
    }
  }
}

}  // namespace

void JoinStudies(const std::vector<StudyFile>& parts, const StudyFile& whole, const std::string& command) {
  const std::map<std::string, json> before = whole.All();
  std::map<std::string, json> cells = before;
  for (const StudyFile& part : parts) {
    for (const auto& [cell, record] : part.All()) {
      const auto [found, is_new] = cells.emplace(cell, record);
      json& joined = found->second;
      const auto refuse = [&, &name = cell](const std::string& what) {
        throw DataError(
            fmt::format("'{}' and '{}' differ in {} of the cell {}: they do not belong together; merge "
                        "into another place",
                        part.path().string(), whole.path().string(), what, name));
      };
      try {
        if (!is_new && Common(joined) != Common(record)) refuse("the settings");
        if (!is_new && record.contains("seeds")) JoinSeeds(record, joined, refuse);
      } catch (const json::exception& e) {
        throw DataError(fmt::format("'{}': the cell {} cannot be read ({}); remove its unit's folder to make it again",
                                    part.path().string(), cell, e.what()));
      }
      joined["command"] = command;
    }
  }
  for (const auto& [cell, record] : cells) {
    const auto old = before.find(cell);
    if (old == before.end() || old->second != record) whole.Put(cell, record);
  }
}

}  // namespace oted
