#include "oted/plan/work_root.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/seal.h"

namespace oted {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* kOwner = "owner.json";
constexpr const char* kDone = "done.json";

/// Gives a file the file server's time.
bool Touch(const fs::path& file) { return ::utimensat(AT_FDCWD, file.c_str(), nullptr, 0) == 0; }

/// When it was last written or touched; by opening it, so that a network file system asks its server. 0 where it is
/// not there. [s]
double TimeOf(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return 0;
  struct stat found {};
  const int result = ::fstat(descriptor, &found);
  ::close(descriptor);
  if (result != 0) return 0;
  return static_cast<double>(found.st_mtim.tv_sec) + 1e-9 * static_cast<double>(found.st_mtim.tv_nsec);
}

/// The file server's time, for clocks of machines differ; this machine's where nothing can be written. [s]
double ServerTime(const fs::path& folder) {
  const fs::path file = folder / ".clock";
  const int descriptor = ::open(file.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor >= 0) ::close(descriptor);
  if (descriptor >= 0 && Touch(file)) return TimeOf(file);
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

void SyncName(const fs::path& path) {
  const int descriptor = ::open(path.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return;
  ::fsync(descriptor);
  ::close(descriptor);
}

/// The seals of the records at the top of a unit's run directory, by their paths from the unit's folder.
json ResultSeals(const fs::path& folder) {
  json seals = json::object();
  if (!fs::is_directory(folder / "result")) return seals;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder / "result")) {
    if (entry.path().extension() != ".json" || !entry.is_regular_file()) continue;
    const std::string seal = SealOf(ReadJson(entry.path()));
    if (!seal.empty()) seals["result/" + entry.path().filename().string()] = seal;
  }
  return seals;
}

/// What is wrong with a record that a unit left, "" where nothing is.
std::string WhatIsWrong(SourceState state, const fs::path& unit) {
  switch (state) {
    case SourceState::kSame:
      return "";
    case SourceState::kMissing:
      return "is missing";
    case SourceState::kNoJson:
      return "is damaged: it is no JSON";
    case SourceState::kAltered:
      return "is not as oted wrote it (its seal does not fit its content)";
    case SourceState::kAnother:
      return fmt::format("is another than the one that '{}' speaks of", unit.string());
  }
  throw InternalError("unknown state of a source");
}

/// @throws DataError where a record is not the one that the unit left
void CheckResultSeals(const json& record, const fs::path& file) {
  for (const SealedSource& source : SourcesOf(record, file)) {
    const std::string why = WhatIsWrong(StateOf(source), file);
    if (why.empty()) continue;
    throw DataError(fmt::format("'{}' {}; restore it, or remove '{}' and submit the plan to make the unit again",
                                source.path.string(), why, file.parent_path().string()));
  }
}

/// @return 0, or what the system says
int Move(const fs::path& from, const fs::path& to) {
  if (std::rename(from.c_str(), to.c_str()) != 0) return errno;
  SyncName(to);
  return 0;
}

[[noreturn]] void FailMove(const fs::path& to, int error) {
  throw DataError(fmt::format("cannot write '{}': {}; free space or fix its permissions, and run the unit again",
                              to.string(), std::strerror(error)));
}

/// The number of a work folder, 0 for another.
int NumberOf(const fs::path& folder) {
  const std::string name = folder.filename().string();
  const bool is_number = !name.empty() && name.size() < 9 && name.find_first_not_of("0123456789") == std::string::npos;
  return is_number ? std::stoi(name) : 0;
}

/// The newest work folder of a unit; "" where there is none.
fs::path Newest(const fs::path& runs) {
  fs::path newest;
  std::error_code gone;
  for (fs::directory_iterator entry(runs, gone), end; !gone && entry != end; entry.increment(gone)) {
    if (NumberOf(entry->path()) > (newest.empty() ? 0 : NumberOf(newest))) newest = entry->path();
  }
  return newest;
}

/// What a lost process left in the way of the next one. Its locks are on these files, wherever it ran.
void RemoveLocks(const fs::path& folder) {
  std::vector<fs::path> locks;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().filename() == ".lock") locks.push_back(entry.path());
  }
  for (const fs::path& lock : locks) RemoveFile(lock);
}

json ReadOwner(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::exists(folder / kOwner, ignored)) return json::object();
  json record = json::parse(ReadFile(folder / kOwner), nullptr, false);
  return record.is_object() ? record : json::object();
}

int CountIn(const json& record, const char* name) {
  return record.contains(name) && record.at(name).is_number_integer() ? record.at(name).get<int>() : 0;
}

std::set<std::string> Names(const fs::path& folder) {
  std::set<std::string> names;
  std::error_code none;
  for (fs::directory_iterator entry(folder, none), end; !none && entry != end; entry.increment(none)) {
    names.insert(entry->path().filename().string());
  }
  return names;
}

}  // namespace

bool UnitClaim::Beat() const { return Touch(folder_ / kOwner); }

void UnitClaim::WriteOwner() const {
  WriteJson(folder_ / kOwner, {{"owner", owner_.ToJson()}, {"attempts", attempts_}, {"breaks", breaks_}});
}

void UnitClaim::AddBreak() {
  ++breaks_;
  if (Beat()) WriteOwner();
}

void UnitClaim::RemoveRuns() const {
  std::error_code ignored;
  fs::remove_all(folder_.parent_path(), ignored);
}

bool UnitClaim::Publish(const UnitRecord& record) {
  json sealed = record.ToJson();
  const bool has_records = fs::exists(folder_ / "result.jsonl");
  if (const json seals = ResultSeals(folder_); !seals.empty()) sealed["made_from"] = seals;
  Seal(sealed, folder_, has_records ? std::vector<std::string>{"result.jsonl"} : std::vector<std::string>{});
  if (!Beat()) return false;
  RemoveFile(folder_ / kOwner);
  WriteJson(folder_ / kDone, sealed);
  const fs::path to = root_ / "units" / unit_;
  MakeFolders(to.parent_path());
  const int error = Move(folder_, to);
  if (error == ENOENT) return false;
  if (error != 0 && error != ENOTEMPTY && error != EEXIST) FailMove(to, error);
  RemoveRuns();
  return error == 0;
}

bool UnitClaim::Fail(const UnitRecord& record) {
  if (!Beat()) return false;
  json sealed = record.ToJson();
  Seal(sealed);
  WriteJson(root_ / "failed" / (unit_ + ".json"), sealed);
  // What it made stays for whoever looks into it, and for the next try where the failure is forgotten.
  Release();
  return true;
}

void UnitClaim::Release() {
  UnitOwner nobody = owner_;
  owner_.pid = 0;
  if (Beat()) WriteOwner();
  owner_ = nobody;
}

WorkRoot::WorkRoot(fs::path root, UnitOwner me, std::chrono::seconds lease)
    : root_(std::move(root)), me_(std::move(me)), lease_(lease) {
  for (const char* name : {"", "units", "failed", "runs"}) {
    const fs::path folder = root_ / name;
    if (!fs::exists(folder) || fs::is_directory(folder)) continue;
    throw DataError(fmt::format("'{}' is no folder, wanted one for units; remove it, or name another folder by --out",
                                folder.lexically_normal().string()));
  }
}

std::pair<ClaimResult, std::optional<UnitClaim>> WorkRoot::Claim(const std::string& unit) const {
  const auto ended = [&]() -> std::optional<ClaimResult> {
    if (fs::exists(Result(unit))) return ClaimResult::kDone;
    if (fs::exists(FailedFile(unit))) return ClaimResult::kFailed;
    return std::nullopt;
  };
  if (const auto result = ended()) {
    if (*result == ClaimResult::kDone) RemoveLeftoversOf(unit);
    return {*result, std::nullopt};
  }
  const fs::path runs = root_ / "runs" / unit;
  MakeFolders(runs);
  UnitClaim claim(root_, unit, me_);
  const std::optional<BegunUnit> begun = Look(runs, ServerTime(runs));
  if (!begun) {
    claim.folder_ = runs / "1";
    if (!fs::create_directory(claim.folder_)) return {ClaimResult::kBusy, std::nullopt};
  } else {
    if (begun->runs) return {ClaimResult::kBusy, std::nullopt};
    claim.folder_ = runs / std::to_string(NumberOf(begun->folder) + 1);
    // Whoever looks between this and the next line sees a living owner.
    if (!Touch(begun->folder / kOwner)) WriteJson(begun->folder / kOwner, json::object());
    const int error = Move(begun->folder, claim.folder_);
    if (error == ENOENT || error == ENOTEMPTY || error == EEXIST) return {ClaimResult::kBusy, std::nullopt};
    if (error != 0) FailMove(claim.folder_, error);
    const json before = ReadOwner(claim.folder_);
    claim.attempts_ = CountIn(before, "attempts");
    claim.breaks_ = CountIn(before, "breaks");
    RemoveLocks(claim.folder_);
  }
  ++claim.attempts_;
  claim.WriteOwner();
  // Another process may have ended the unit since the first look.
  if (const auto result = ended()) {
    claim.RemoveRuns();
    return {*result, std::nullopt};
  }
  return {ClaimResult::kMine, std::move(claim)};
}

void WorkRoot::RemoveLeftoversOf(const std::string& unit) const {
  const fs::path runs = root_ / "runs" / unit;
  if (!fs::exists(runs)) return;
  const std::optional<BegunUnit> begun = Look(runs, ServerTime(runs));
  std::error_code ignored;  // they are in nobody's way
  if (!begun || !begun->runs) fs::remove_all(runs, ignored);
}

void WorkRoot::RemoveLeftovers() const {
  const std::set<std::string> done = Done();
  for (const std::string& unit : Names(root_ / "runs")) {
    if (done.contains(unit)) RemoveLeftoversOf(unit);
  }
}

std::optional<BegunUnit> WorkRoot::Look(const fs::path& runs, double now) const {
  BegunUnit unit;
  unit.folder = Newest(runs);
  if (unit.folder.empty()) return std::nullopt;
  double last = TimeOf(unit.folder / kOwner);
  // Just made: the owner writes its name next.
  if (last == 0) last = TimeOf(unit.folder);
  unit.silent_s = std::max(0.0, now - last);
  const json record = ReadOwner(unit.folder);
  unit.owner = UnitOwner::FromJson(record.value("owner", json()));
  const bool was_left = record.contains("owner") && unit.owner.pid == 0;
  unit.runs = !was_left && !unit.owner.IsGone() && unit.silent_s < static_cast<double>(lease_.count());
  return unit;
}

std::set<std::string> WorkRoot::Done() const { return Names(root_ / "units"); }

std::set<std::string> WorkRoot::Failed() const {
  std::set<std::string> units;
  for (const std::string& name : Names(root_ / "failed")) {
    if (name.ends_with(".json")) units.insert(name.substr(0, name.size() - std::strlen(".json")));
  }
  return units;
}

std::map<std::string, BegunUnit> WorkRoot::Begun() const {
  std::map<std::string, BegunUnit> begun;
  if (!fs::is_directory(root_ / "runs")) return begun;
  const double now = ServerTime(root_ / "runs");
  for (const std::string& unit : Names(root_ / "runs")) {
    if (const auto found = Look(root_ / "runs" / unit, now)) begun.emplace(unit, *found);
  }
  return begun;
}

UnitRecord WorkRoot::ReadDone(const std::string& unit) const {
  const fs::path file = Result(unit) / kDone;
  const json record = ReadSealed(file);
  for (const auto& [name, unused] : SealedFiles(record, file.string())) CheckSealedFile(record, file, name);
  CheckResultSeals(record, file);
  return UnitRecord::FromJson(record, file.string());
}

UnitRecord WorkRoot::ReadFailed(const std::string& unit) const {
  const fs::path file = FailedFile(unit);
  return UnitRecord::FromJson(ReadSealed(file), file.string());
}

void WorkRoot::ForgetFailure(const std::string& unit) const { RemoveFile(FailedFile(unit)); }

}  // namespace oted
