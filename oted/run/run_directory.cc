#include "oted/run/run_directory.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

using nlohmann::json;

std::string TextIn(const json& record, const char* field) {
  const bool has = record.is_object() && record.contains(field) && record.at(field).is_string();
  return has ? record.at(field).get<std::string>() : "";
}

/// The record, where it is the artefact's. @throws UsageError where it is another's
json CompleteRecord(const Artifact& artifact, const std::filesystem::path& root) {
  json record = ReadJson(artifact.file);
  const std::string fingerprint = TextIn(record, "fingerprint");
  if (fingerprint.empty() || TextIn(record, "schema") != artifact.schema) {
    throw UsageError(
        fmt::format("'{}' was made by another version of oted; choose another --out", artifact.file.string()));
  }
  if (fingerprint == artifact.fingerprint) return record;
  const std::filesystem::path folder = artifact.file.parent_path();
  throw UsageError(
      fmt::format("'{}' was made with other data, settings or an earlier stage that has changed; choose another --out, "
                  "or remove '{}'",
                  artifact.file.string(), (folder == root ? artifact.file : folder).string()));
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

bool RunDirectory::IsComplete(const Artifact& artifact) const {
  if (!std::filesystem::exists(artifact.file)) return false;
  CompleteRecord(artifact, root_);
  return true;
}

void RunDirectory::Check(const Artifact& artifact) const {
  if (!IsComplete(artifact)) CheckCheckpoint(artifact);
}

json RunDirectory::Once(const Artifact& artifact, const std::function<json()>& make) const {
  if (std::filesystem::exists(artifact.file)) return CompleteRecord(artifact, root_);
  Begin(artifact);
  json record = make();
  Complete(artifact, record);
  return record;
}

void RunDirectory::CheckCheckpoint(const Artifact& artifact) const {
  const std::filesystem::path folder = artifact.file.parent_path(), mark = folder / "checkpoint.json";
  if (!HasFolder(artifact) || !std::filesystem::exists(folder / "checkpoint.npz")) return;
  if (std::filesystem::exists(mark) && TextIn(ReadJson(mark), "fingerprint") == artifact.fingerprint) return;
  throw UsageError(
      fmt::format("'{}' holds work that was stopped and had other data or settings; choose another --out, go on with "
                  "its own settings, or remove the folder",
                  folder.string()));
}

void RunDirectory::Begin(const Artifact& artifact) const {
  if (!HasFolder(artifact)) return;
  CheckCheckpoint(artifact);
  WriteJson(artifact.file.parent_path() / "checkpoint.json", {{"fingerprint", artifact.fingerprint}});
}

void RunDirectory::Complete(const Artifact& artifact, json& record) const {
  record["fingerprint"] = artifact.fingerprint;
  WriteJson(artifact.file, record);
  if (!HasFolder(artifact)) return;
  std::filesystem::remove(artifact.file.parent_path() / "checkpoint.npz");
  std::filesystem::remove(artifact.file.parent_path() / "checkpoint.json");
}

}  // namespace oted
