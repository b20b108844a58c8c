#include "oted/run/run_directory.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

/// Empty where the file is the JSON of something else.
std::string FingerprintIn(const std::filesystem::path& file) {
  const nlohmann::json result = ReadJson(file);
  if (!result.is_object() || !result.contains("fingerprint") || !result["fingerprint"].is_string()) return "";
  return result["fingerprint"].get<std::string>();
}

}  // namespace

RunDirectory::RunDirectory(std::filesystem::path root) : root_(std::move(root)) {
  // Found out now, not after an hour of work.
  AtomicFile probe(root_ / "writable");
  WriteFileAtomically(probe.temporary_path(), "");
}

std::string RunDirectory::NameOf(const std::filesystem::path& folder) const {
  return std::filesystem::relative(folder, root_).string();
}

bool RunDirectory::IsComplete(const std::filesystem::path& file, const std::string& fingerprint) const {
  if (!std::filesystem::exists(file)) return false;
  if (FingerprintIn(file) == fingerprint) return true;
  throw UsageError(
      fmt::format("'{}' was made with other data, settings or an earlier stage that has changed; choose another --out, "
                  "or remove '{}'",
                  file.string(), file.parent_path() == root_ ? file.string() : file.parent_path().string()));
}

void RunDirectory::Complete(const std::filesystem::path& file, nlohmann::json result,
                            const std::string& fingerprint) const {
  result["fingerprint"] = fingerprint;
  WriteJson(file, result);
}

void RunDirectory::CheckCheckpoint(const std::filesystem::path& folder, const std::string& fingerprint) const {
  if (!std::filesystem::exists(folder / "checkpoint.npz")) return;
  const std::filesystem::path mark = folder / "checkpoint.json";
  if (std::filesystem::exists(mark) && FingerprintIn(mark) == fingerprint) return;
  throw UsageError(
      fmt::format("'{}' holds work that was stopped and had other data or settings; choose another --out, go on with "
                  "its own settings, or remove the folder",
                  folder.string()));
}

void RunDirectory::Begin(const std::filesystem::path& folder, const std::string& fingerprint) const {
  CheckCheckpoint(folder, fingerprint);
  WriteJson(folder / "checkpoint.json", {{"fingerprint", fingerprint}});
}

void RunDirectory::RemoveCheckpoint(const std::filesystem::path& folder) const {
  std::filesystem::remove(folder / "checkpoint.npz");
  std::filesystem::remove(folder / "checkpoint.json");
}

std::string Fingerprint(const nlohmann::json& inputs) { return Sha256(inputs.dump()).substr(0, 16); }

nlohmann::json ParameterIdentity(const ParameterSpace& space) {
  nlohmann::json list = nlohmann::json::array();
  for (const ParameterSpec& spec : space.specs()) {
    list.push_back(
        {spec.name, spec.field, spec.low, spec.high, spec.logarithmic, spec.scale == ParameterScale::kAbsolute});
  }
  return list;
}

}  // namespace oted
