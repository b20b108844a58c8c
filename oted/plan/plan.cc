#include "oted/plan/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

[[noreturn]] void Refuse(const std::string& where, const std::string& why) {
  throw DataError(fmt::format("'{}': {}; write the plan again with 'oted plan'", where, why));
}

/// A folder's is that of the names and hashes of its files.
std::string HashOf(const fs::path& path) {
  if (!fs::is_directory(path)) return Sha256OfFile(path);
  std::map<std::string, std::string> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path)) {
    if (entry.is_regular_file()) files[fs::relative(entry.path(), path).string()] = Sha256OfFile(entry.path());
  }
  return Sha256(json(files).dump());
}

}  // namespace

const NamedValues<PlanKind>& PlanKindNames() {
  static const NamedValues<PlanKind> names = {{PlanKind::kStudy, "study"}, {PlanKind::kSweep, "sweep"}};
  return names;
}

PlanInput PlanInput::Of(const fs::path& path) {
  if (!fs::exists(path)) throw DataError(fmt::format("'{}' does not exist; a unit would read it", path.string()));
  return {fs::absolute(path).lexically_normal().string(), HashOf(path)};
}

json PlanLine::ToJson() const {
  json line = {{"key", key},
               {"name", name},
               {"words", words},
               {"inputs", json::array()},
               {"labels", json::array()},
               {"needs", {{"threads", needs.threads}, {"memory_mib", needs.memory_mib}, {"minutes", needs.minutes}}}};
  for (const PlanInput& input : inputs) line["inputs"].push_back({{"path", input.path}, {"sha256", input.sha256}});
  for (const auto& [label, value] : labels) line["labels"].push_back({label, value});
  return line;
}

PlanLine PlanLine::FromJson(const json& line, const std::string& where) {
  PlanLine result;
  try {
    result.key = line.at("key");
    result.name = line.at("name");
    result.words = line.at("words").get<std::vector<std::string>>();
    for (const json& input : line.at("inputs")) result.inputs.push_back({input.at("path"), input.at("sha256")});
    for (const json& label : line.at("labels")) result.labels.emplace_back(label.at(0), label.at(1));
    const json& needs = line.at("needs");
    result.needs = {needs.at("threads"), needs.at("memory_mib"), needs.at("minutes")};
  } catch (const json::exception& e) {
    Refuse(where, fmt::format("it is no unit of a plan ({})", e.what()));
  }
  const bool is_hash = result.key.size() == 64 && result.key.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (!is_hash) Refuse(where, "its key is no SHA-256");
  return result;
}

UnitNeeds Plan::MostNeeds() const {
  UnitNeeds most{1, 1, 1};
  for (const PlanLine& line : lines) {
    most.threads = std::max(most.threads, line.needs.threads);
    most.memory_mib = std::max(most.memory_mib, line.needs.memory_mib);
    most.minutes = std::max(most.minutes, line.needs.minutes);
  }
  return most;
}

std::string Plan::ToText() const {
  if (lines.empty()) throw UsageError("the plan has no units; name at least one of everything that it varies");
  std::map<std::string, std::string> name_of;
  std::string text;
  for (const PlanLine& line : lines) {
    const auto [other, is_new] = name_of.emplace(line.Folder(), line.name);
    if (!is_new) {
      throw UsageError(fmt::format("'{}' and '{}' are the same work: the same settings, seed and data; name it once",
                                   other->second, line.name));
    }
    text += line.ToJson().dump() + "\n";
  }
  const json head = {{"schema", kSchema},     {"kind", NameOf(PlanKindNames(), kind)},
                     {"version", version},    {"command", command},
                     {"units", lines.size()}, {"sha256", Sha256(text)}};
  return head.dump() + "\n" + text;
}

Plan Plan::Read(const fs::path& file) {
  const std::string text = ReadFile(file), where = file.string();
  const size_t end = text.find('\n');
  const json head = json::parse(text.substr(0, end), nullptr, false);
  if (end == std::string::npos || !head.is_object() || head.value("schema", json()) != kSchema) {
    Refuse(where, fmt::format("its first line is no head of a plan ({})", kSchema));
  }
  const std::string body = text.substr(end + 1);
  Plan plan;
  try {
    plan.version = head.at("version");
    plan.command = head.at("command").get<std::vector<std::string>>();
    if (head.at("sha256") != Sha256(body)) Refuse(where, "it is not as it was written");
    const auto kind = std::ranges::find(PlanKindNames(), head.at("kind").get<std::string>(),
                                        &std::pair<PlanKind, std::string>::second);
    if (kind == PlanKindNames().end()) Refuse(where, "its kind is unknown");
    plan.kind = kind->first;
    if (plan.kind == PlanKind::kStudy && plan.command.empty()) Refuse(where, "its head names no command of the study");
  } catch (const json::exception& e) {
    Refuse(where, fmt::format("its head cannot be read ({})", e.what()));
  }
  for (size_t at = 0; at < body.size();) {
    const size_t next = std::min(body.find('\n', at), body.size());
    const std::string line_where = fmt::format("{} line {}", where, plan.lines.size() + 2);
    plan.lines.push_back(PlanLine::FromJson(json::parse(body.substr(at, next - at), nullptr, false), line_where));
    at = next + 1;
  }
  return plan;
}

std::string UnitKey(const json& identity) {
  return Sha256(json({{"schema", "oted.unit/1"}, {"version", OTED_VERSION}, {"identity", identity}}).dump());
}

}  // namespace oted
