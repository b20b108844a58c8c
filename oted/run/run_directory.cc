#include "oted/run/run_directory.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "oted/base/curves_log.h"
#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/data/whole_mark.h"
#include "oted/rl/starts.h"
#include "oted/run/run_lock.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

std::string TextIn(const json& record, const char* field) {
  const bool has = record.is_object() && record.contains(field) && record.at(field).is_string();
  return has ? record.at(field).get<std::string>() : "";
}

/// What a run makes in its directory. Other folders there are not its own.
constexpr std::array<const char*, 9> kFolders = {"agents", "baselines", "clone",  "design", "export",
                                                 "growth", "model",     "motion", "nominal"};
/// What work that can be stopped keeps beside its result: the work, whose it is, and how far its curves are whole.
constexpr std::array<const char*, 3> kCheckpoint = {"checkpoint.npz", "checkpoint.json", "checkpoint.curves"};

/// An agent that has not chosen among its starts yet keeps work there alone.
bool HoldsWork(const fs::path& folder) {
  return fs::exists(folder / "checkpoint.npz") || fs::exists(folder / kStartsFolder);
}

}  // namespace

/// A stage that was made, or begun, with other settings.
class RunDirectory::OfOtherSettings : public UsageError {
 public:
  OfOtherSettings(const std::string& message, fs::path stage_) : UsageError(message), stage(std::move(stage_)) {}
  fs::path stage;  ///< what to remove before it can be made with these
};

/// What lies at an artefact's place.
struct RunDirectory::Found {
  enum class State { kMissing, kWhole, kDamaged };
  State state = State::kMissing;
  json record = {};  ///< null where it cannot be read
  std::string why = {};
};

/// What a directory that is written to has beside its place.
struct RunDirectory::Held {
  Held(const fs::path& root, LogSink* log_) : lock(root), guard(root, [this] { lock.CheckPlace(); }), log(log_) {}
  RunLock lock;
  WriteGuard guard;
  LogSink* log;
  std::mutex mutex;
  std::set<std::string> warned;
  std::map<fs::path, std::string> whole;  ///< seals of records whose files were found whole: each is read once
};

RunDirectory::RunDirectory(fs::path root, LogSink* log) : root_(std::move(root)) {
  MakeFolders(root_);
  held_ = std::make_shared<Held>(root_, log);
  // Found out now, not after an hour of work. Nor would a file that stays be anybody's to remove while this program
  // lives.
  const AtomicFile probe(root_ / "writable");
  WriteFileAtomically(probe.temporary_path(), "");
  RemoveFile(probe.temporary_path());
  RemoveTemporaries(root_, kFolders);
}

RunDirectory RunDirectory::At(fs::path root) {
  RunDirectory directory;
  directory.root_ = std::move(root);
  return directory;
}

std::string RunDirectory::NameOf(const fs::path& folder) const { return fs::relative(folder, root_).string(); }

void RunDirectory::Warn(const std::string& message) const {
  if (held_ == nullptr) return;
  {
    const std::lock_guard lock(held_->mutex);
    if (!held_->warned.insert(message).second) return;
  }
  if (held_->log != nullptr) held_->log->Warning(message);
}

json RunDirectory::ReadRecord(const Artifact& artifact, const std::string& text) const {
  json record = ParseJson(text, artifact.file.string());
  const std::string fingerprint = TextIn(record, "fingerprint");
  if (fingerprint.empty() || TextIn(record, "schema") != artifact.schema || SealOf(record).empty()) {
    throw UsageError(
        fmt::format("'{}' was made by another version of oted; choose another --out", artifact.file.string()));
  }
  const fs::path folder = artifact.file.parent_path();
  const std::string stage = (folder == root_ ? artifact.file : folder).string();
  if (!IsSealed(record)) {
    throw DataError(
        fmt::format("'{}' is not as oted wrote it (its seal does not fit its content); restore it, or remove '{}' to "
                    "make it again",
                    artifact.file.string(), stage));
  }
  if (fingerprint == artifact.fingerprint) return record;
  throw OfOtherSettings(
      fmt::format("'{}' was made with other data, settings or an earlier stage that has changed; choose another --out, "
                  "or remove '{}'",
                  artifact.file.string(), stage),
      stage);
}

std::vector<std::string> RunDirectory::TidyDamaged(const Artifact& artifact, const json& record) const {
  std::vector<std::string> needed;
  const fs::path folder = artifact.file.parent_path();
  for (const std::string& name : DamagedFiles(record, artifact.file)) {
    const fs::path file = folder / name;
    if (std::ranges::find(artifact.derived, name) != artifact.derived.end()) {
      if (fs::exists(file)) Warn(fmt::format("'{}' is damaged and is written again", file.string()));
      RemoveFile(file);
    } else if (name == kCurves) {
      // Nothing is made from curves: they are not worth the stage.
      if (fs::exists(file)) fs::rename(file, file.string() + ".damaged");
      Warn(fmt::format("'{}' is damaged or missing: the report lacks its curves; remove '{}' to make them again",
                       file.string(), folder.string()));
    } else {
      needed.push_back(name);
    }
  }
  return needed;
}

RunDirectory::Found RunDirectory::Look(const Artifact& artifact) const {
  using State = Found::State;
  if (!fs::exists(artifact.file)) return {};
  const std::string text = ReadJsonText(artifact.file);
  Found found{State::kWhole};
  try {
    found.record = ReadRecord(artifact, text);
  } catch (const DataError& e) {
    // Text that is no JSON holds nothing that could be lost.
    if (json::accept(text)) throw;
    return {State::kDamaged, nullptr, fmt::format("'{}' is damaged", artifact.file.string())};
  }
  const std::string seal = SealOf(found.record);
  if (held_ != nullptr) {
    const std::lock_guard lock(held_->mutex);
    const auto known = held_->whole.find(artifact.file);
    if (known != held_->whole.end() && known->second == seal) return found;
  }
  const std::vector<std::string> damaged = TidyDamaged(artifact, found.record);
  if (!damaged.empty()) {
    found.state = State::kDamaged;
    found.why = fmt::format("'{}' is damaged or missing", (artifact.file.parent_path() / damaged.front()).string());
  } else if (held_ != nullptr) {
    const std::lock_guard lock(held_->mutex);
    held_->whole[artifact.file] = seal;
  }
  return found;
}

RunDirectory::Found RunDirectory::LookLeniently(const Artifact& artifact) const {
  Found found;
  try {
    found = Look(artifact);
  } catch (const UsageError&) {
    return {};
  } catch (const DataError&) {
    return {Found::State::kDamaged, nullptr, fmt::format("'{}' is damaged", artifact.file.string())};
  }
  if (found.state == Found::State::kDamaged) found.record = nullptr;  // another machine may draw it otherwise
  if (found.state != Found::State::kWhole) return found;
  try {
    CheckMadeFrom(found.record, artifact.file);
    return found;
  } catch (const DataError&) {
    return {};
  }
}

bool RunDirectory::IsComplete(const Artifact& artifact) const { return Look(artifact).state == Found::State::kWhole; }

bool RunDirectory::IsReady(const Artifact& artifact) const {
  const Found found = Look(artifact);
  return found.state == Found::State::kWhole && !LostSource(artifact, found.record);
}

void RunDirectory::Check(const std::vector<Artifact>& artifacts) const {
  std::vector<OfOtherSettings> others;
  std::set<std::string> stages;
  std::optional<DataError> damage;
  for (const Artifact& artifact : artifacts) {
    try {
      CheckOne(artifact);
    } catch (const OfOtherSettings& other) {
      others.push_back(other);
      stages.insert(other.stage.string());
    } catch (const DataError& error) {
      if (!damage) damage = error;
    }
  }
  // A record of other settings is no source of what was made from it: it is told first.
  if (stages.size() == 1) throw others.front();
  if (stages.empty() && damage) throw DataError(*damage);
  if (stages.empty()) return;
  throw UsageError(
      fmt::format("{} stages of '{}' were made, or begun, with other data, settings or an earlier stage that has "
                  "changed; choose another --out, or remove '{}'",
                  stages.size(), root_.string(), fmt::join(stages, "' '")));
}

void RunDirectory::CheckOne(const Artifact& artifact) const {
  const Found found = Look(artifact);
  if (found.state == Found::State::kMissing) CheckCheckpoint(artifact);
  if (found.state == Found::State::kWhole) CheckMadeFrom(found.record, artifact.file);
}

std::optional<fs::path> RunDirectory::LostSource(const Artifact& artifact, const json& record) const {
  for (const SealedSource& source : SourcesOf(record, artifact.file)) {
    const SourceState state = StateOf(source);
    if (state == SourceState::kMissing || state == SourceState::kNoJson) return source.path;
  }
  return std::nullopt;
}

json RunDirectory::Once(const Artifact& artifact, const std::function<json()>& make) const {
  Found found = artifact.is_replaceable ? LookLeniently(artifact) : Look(artifact);
  if (found.state == Found::State::kWhole) {
    // Stages of their own have repaired theirs by now. What is left is made within this one.
    if (const auto lost = LostSource(artifact, found.record)) {
      found.state = Found::State::kDamaged;
      found.why = fmt::format("'{}' is damaged or missing", lost->string());
    }
  }
  if (found.state == Found::State::kWhole) {
    CheckMadeFrom(found.record, artifact.file);
    if (HasFolder(artifact)) RemoveCheckpoint(artifact.file.parent_path());
    return found.record;
  }
  if (found.state == Found::State::kDamaged) {
    Warn(fmt::format("{}: its stage is made again", found.why));
    RemoveFile(artifact.file);
  }
  Begin(artifact);
  json record = make();
  Complete(artifact, record);
  if (!found.record.is_null() && SealOf(found.record) != SealOf(record)) {
    throw DataError(
        fmt::format("{}, and '{}', made again, is another than before (another kind of processor, or another version "
                    "of oted); what was made from it no longer fits: restore the run from a copy, or begin a new one",
                    found.why, artifact.file.string()));
  }
  return record;
}

void RunDirectory::CheckCheckpoint(const Artifact& artifact) const {
  const fs::path folder = artifact.file.parent_path(), mark = folder / "checkpoint.json";
  if (!HasFolder(artifact) || !HoldsWork(folder)) return;
  const std::string made_for =
      fs::exists(mark) ? TextIn(json::parse(ReadJsonText(mark), nullptr, false), "fingerprint") : "";
  if (made_for.empty()) {
    throw DataError(
        fmt::format("'{}', which tells the settings of the work that was stopped there, is damaged or missing; restore "
                    "it, or remove the folder to begin its stage anew",
                    mark.string()));
  }
  if (made_for == artifact.fingerprint) return;
  throw OfOtherSettings(
      fmt::format("'{}' holds work that was stopped and had other data or settings; choose another --out, go on with "
                  "its own settings, or remove the folder",
                  folder.string()),
      folder);
}

void RunDirectory::Begin(const Artifact& artifact) const {
  if (held_ != nullptr) held_->lock.CheckPlace();
  if (!HasFolder(artifact)) return;
  CheckCheckpoint(artifact);
  const fs::path folder = artifact.file.parent_path();
  if (!fs::exists(folder / "checkpoint.npz")) {
    // The work begins anew, and so do its curves, which had been noted with a checkpoint.
    if (fs::exists(folder / "checkpoint.curves")) {
      Warn(fmt::format("'{}' has no saved state: its stage begins anew", folder.string()));
    }
    RemoveFile(folder / "checkpoint.curves");
    RemoveFile(folder / kCurves);
  }
  WriteJson(folder / "checkpoint.json", {{"fingerprint", artifact.fingerprint}});
}

void RunDirectory::Complete(const Artifact& artifact, json& record) const {
  if (held_ != nullptr) held_->lock.CheckPlace();
  const fs::path folder = artifact.file.parent_path();
  if (HasFolder(artifact)) {
    // Each seed and agent has files of its own: held to the end of a stage, they would be as many as these.
    if (CurvesLog* curves = held_ == nullptr ? nullptr : CurvesOf(held_->log)) curves->Finish(NameOf(folder));
    SetAsideDamagedCurves(folder);
  }
  record["fingerprint"] = artifact.fingerprint;
  record.erase("made_from");
  for (const fs::path& source : artifact.made_from) {
    if (!fs::exists(source)) continue;
    record["made_from"][source.lexically_relative(folder).generic_string()] = SealOf(ReadSealed(source));
  }
  std::vector<std::string> files = artifact.files;
  files.insert(files.end(), artifact.derived.begin(), artifact.derived.end());
  if (HasFolder(artifact)) files.push_back(kCurves);
  std::erase_if(files, [&](const std::string& name) { return !fs::exists(folder / name); });
  Seal(record, folder, files);
  WriteJson(artifact.file, record);
  if (HasFolder(artifact)) RemoveCheckpoint(folder);
}

void RunDirectory::SetAsideDamagedCurves(const fs::path& folder) const {
  const fs::path curves = folder / kCurves, mark_file = folder / "checkpoint.curves";
  if (!fs::exists(mark_file) || !fs::exists(curves)) return;
  const auto mark = WholeMark::FromText(ReadFile(mark_file));
  if (mark && mark->Fits(ReadFile(curves))) return;
  fs::rename(curves, curves.string() + ".damaged");
  Warn(fmt::format("'{}' was damaged or cut short: it is kept as curves.csv.damaged, and the report lacks its curves",
                   curves.string()));
}

void RunDirectory::RemoveCheckpoint(const fs::path& folder) const {
  for (const char* name : kCheckpoint) RemoveFile(folder / name);
  fs::remove_all(folder / kStartsFolder);
}

}  // namespace oted
