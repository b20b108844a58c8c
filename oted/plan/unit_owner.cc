#include "oted/plan/unit_owner.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <system_error>

#include "oted/base/process.h"

namespace oted {
namespace {

using nlohmann::json;

std::string FirstLine(const std::string& file) {
  std::string line;
  std::ifstream stream(file);
  std::getline(stream, line);
  return line;
}

/// 0 where no such process runs.
uint64_t StartOf(int pid) { return ProcessStart(pid).value_or(0); }

}  // namespace

UnitOwner UnitOwner::Me() {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) host[0] = '\0';
  std::error_code ignored;
  const std::string container = std::filesystem::read_symlink("/proc/self/ns/pid", ignored).string();
  return {host.data(), FirstLine("/proc/sys/kernel/random/boot_id") + " " + container, ::getpid(), StartOf(::getpid())};
}

bool UnitOwner::IsGone() const {
  if (pid <= 0) return false;
  const UnitOwner me = Me();
  return space == me.space && StartOf(pid) != started;
}

json UnitOwner::ToJson() const { return {{"host", host}, {"space", space}, {"pid", pid}, {"started", started}}; }

UnitOwner UnitOwner::FromJson(const json& record) {
  try {
    return {record.at("host"), record.at("space"), record.at("pid"), record.at("started")};
  } catch (const json::exception&) {
    return {};
  }
}

}  // namespace oted
