#pragma once
/// The shared folder in which machines make the units of plans. Of its file system it needs that a rename and the
/// making of a folder are atomic, and that others see them within seconds.
///
///   units/KEY/        a finished unit: done.json (UnitRecord), log.txt, its result
///   failed/KEY.json   a unit that would fail again (UnitRecord)
///   runs/KEY/N/       a unit at work, or stopped; N grows by one with each process that goes on with it
///
/// A process has a unit by having made or renamed the folder N, which the file system grants one alone. While it works,
/// it touches owner.json there. Once that is old, or its process is known to be gone, the next one may rename the
/// folder: it then has all that was made so far, and the former owner has lost the place where it writes.

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "oted/plan/unit_owner.h"
#include "oted/plan/unit_record.h"

namespace oted {

/// How old an owner's last sign of life may be.
inline constexpr std::chrono::seconds kLease{120};

/// One process's right to work on a unit.
class UnitClaim {
 public:
  const std::filesystem::path& folder() const { return folder_; }
  int attempts() const { return attempts_; }
  int breaks() const { return breaks_; }

  /// A sign of life. @return false when another process has the unit now
  bool Beat() const;
  /// Counts an end that may not repeat itself.
  void AddBreak();
  /// Makes the folder the unit's result. @return false when another process was first, whose result stays
  bool Publish(const UnitRecord& record);
  /// Keeps the unit from being begun again. @return false as Publish
  bool Fail(const UnitRecord& record);
  /// Leaves the unit to whoever goes on with it.
  void Release();

 private:
  friend class WorkRoot;
  UnitClaim(std::filesystem::path root, std::string unit, UnitOwner owner)
      : root_(std::move(root)), unit_(std::move(unit)), owner_(std::move(owner)) {}
  void WriteOwner() const;
  void RemoveRuns() const;

  std::filesystem::path root_;
  std::string unit_;
  UnitOwner owner_;
  std::filesystem::path folder_;
  int attempts_ = 0, breaks_ = 0;
};

/// What a claim ended with.
enum class ClaimResult { kMine, kDone, kFailed, kBusy };

/// A unit that is neither done nor failed and was begun.
struct BegunUnit {
  std::filesystem::path folder;
  UnitOwner owner;
  double silent_s = 0;  ///< since the last sign of life
  bool runs = false;    ///< somebody works on it
};

class WorkRoot {
 public:
  /// @throws DataError when something else than a folder is in the way
  explicit WorkRoot(std::filesystem::path root, UnitOwner me = UnitOwner::Me(), std::chrono::seconds lease = kLease);

  const std::filesystem::path& path() const { return root_; }
  std::filesystem::path Result(const std::string& unit) const { return root_ / "units" / unit; }
  std::filesystem::path FailedFile(const std::string& unit) const { return root_ / "failed" / (unit + ".json"); }

  /// @param unit  PlanLine::Folder. @throws DataError when the folder takes no files
  std::pair<ClaimResult, std::optional<UnitClaim>> Claim(const std::string& unit) const;

  /// Units by name, as the folders list them now.
  std::set<std::string> Done() const;
  std::set<std::string> Failed() const;
  std::map<std::string, BegunUnit> Begun() const;

  UnitRecord ReadDone(const std::string& unit) const;
  UnitRecord ReadFailed(const std::string& unit) const;
  /// Removes the work folders of units that are done: of processes that died, or had no permission, before they did.
  void RemoveLeftovers() const;
  /// Lets a failed unit be begun anew.
  void ForgetFailure(const std::string& unit) const;

 private:
  void RemoveLeftoversOf(const std::string& unit) const;
  std::optional<BegunUnit> Look(const std::filesystem::path& runs, double now) const;

  std::filesystem::path root_;
  UnitOwner me_;
  std::chrono::seconds lease_;
};

}  // namespace oted
