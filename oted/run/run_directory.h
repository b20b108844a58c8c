#pragma once
/// Where a run's artefacts lie, which of them are complete, and "make it unless it is" (docs/file_formats.md).

#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "oted/base/log.h"

namespace oted {

/// Beside the record of a stage that learns step by step.
inline constexpr const char* kCurves = "curves.csv";

/// One record that a stage leaves: a JSON file, and in the same folder what it speaks for.
struct Artifact {
  std::filesystem::path file;
  std::string schema;
  std::string fingerprint;              ///< of everything that it depends on (oted/run/artifacts.h)
  std::vector<std::string> files = {};  ///< that the stage leaves beside it, where it does
  /// The same, of files that can be written again without the stage: whoever uses one writes a missing one.
  std::vector<std::string> derived = {};
  /// The records that it is made from, where they are there.
  std::vector<std::filesystem::path> made_from = {};
  bool is_guest = false;        ///< checkpoints and curves beside it are another stage's
  bool is_replaceable = false;  ///< no result rests on it: where it is of other settings it is simply made again
};

class RunDirectory {
 public:
  /// Of no run yet.
  RunDirectory() = default;
  /// Makes the folder and holds its lock (RunLock) as long as this object or a copy of it lives. What programs that
  /// died in it left half-written is removed. @param log  is told of what is repaired; may be null
  /// @throws DataError when the folder cannot be made or written to, UsageError when another program works in it.
  explicit RunDirectory(std::filesystem::path root, LogSink* log = nullptr);
  /// Only to find files: nothing is made, held or written.
  static RunDirectory At(std::filesystem::path root);

  const std::filesystem::path& root() const { return root_; }
  std::filesystem::path clone() const { return root_ / "clone"; }
  std::filesystem::path design_seed(const std::string& setting, int seed) const {
    return root_ / "design" / setting / std::to_string(seed);
  }
  /// Of the methods that auto tries on part of the logs.
  std::filesystem::path trials(const std::string& setting) const { return root_ / "design" / setting / "methods"; }
  /// Of a round in which the parameters grow.
  std::filesystem::path growth(int round) const { return root_ / "growth" / std::to_string(round); }
  std::filesystem::path growth_design(int round) const { return growth(round) / "design"; }
  std::filesystem::path agent(int index) const { return root_ / "agents" / std::to_string(index); }
  std::filesystem::path nominal(int index) const { return root_ / "nominal" / std::to_string(index); }
  /// Of a baseline: its agents' common folder, or that of one of them.
  std::filesystem::path baseline(const std::string& name) const { return root_ / "baselines" / name; }
  std::filesystem::path baseline(const std::string& name, int index) const {
    return baseline(name) / std::to_string(index);
  }
  /// The folder's name relative to the run directory: what names its curves.
  std::string NameOf(const std::filesystem::path& folder) const;

  /// True when the artefact is there, whole, and was made from the same settings. What can be written again without
  /// the stage is removed, with a warning, where it is damaged. @throws UsageError when it was made from other
  /// settings, or by another version: results of two configurations never mix in one directory. @throws DataError when
  /// its record is not as it was written: an edit cannot be told from damage, and making the stage again would lose it
  bool IsComplete(const Artifact& artifact) const;
  /// Whether Once would read it: it is complete, and the records that it was made from are there.
  bool IsReady(const Artifact& artifact) const;
  /// The same of each of a run's artefacts; and where one is complete, checks that it was made from the records that
  /// are there (CheckMadeFrom); where it is not, that work which was stopped can go on (CheckCheckpoint).
  /// @throws UsageError that names all that was made, or begun, with other settings
  void Check(const std::vector<Artifact>& artifacts) const;

  /// The artefact's record: read where it is complete; otherwise what `make` gives, which is sealed with the files
  /// beside it and written as the mark of completion. What a stopped `make` left as checkpoint.npz beside it is kept
  /// for the next call, and removed then. A record that was made is the same as one that was read. Where a file beside
  /// the record, or a record that it was made from, is damaged or missing, the stage is made again, with a warning.
  /// @throws DataError when it then is not what it was, or when the record was made from others than those that are
  /// there
  nlohmann::json Once(const Artifact& artifact, const std::function<nlohmann::json()>& make) const;

  /// Work that can be stopped keeps checkpoint.npz in its folder (an agent's starts: in starts/), and beside it what
  /// the work is made from.
  /// @throws UsageError when the artefact's folder holds a checkpoint of other settings.
  void CheckCheckpoint(const Artifact& artifact) const;

 private:
  struct Found;
  struct Held;
  class OfOtherSettings;

  /// An artefact on top of the run has no folder of its own, and so no checkpoint.
  bool HasFolder(const Artifact& artifact) const {
    return !artifact.is_guest && !artifact.is_replaceable && artifact.file.parent_path() != root_;
  }
  void CheckOne(const Artifact& artifact) const;
  Found Look(const Artifact& artifact) const;
  /// Of one that is for show: other settings and sources are no error.
  Found LookLeniently(const Artifact& artifact) const;
  nlohmann::json ReadRecord(const Artifact& artifact, const std::string& text) const;
  /// Sets aside what the stage is not needed for. @return what it is needed for
  std::vector<std::string> TidyDamaged(const Artifact& artifact, const nlohmann::json& record) const;
  /// A record that it was made from and that is missing or no JSON.
  std::optional<std::filesystem::path> LostSource(const Artifact& artifact, const nlohmann::json& record) const;
  void Begin(const Artifact& artifact) const;
  void Complete(const Artifact& artifact, nlohmann::json& record) const;
  /// Work that went on from its last checkpoint may have added nothing to curves that were damaged meanwhile.
  void SetAsideDamagedCurves(const std::filesystem::path& folder) const;
  void RemoveCheckpoint(const std::filesystem::path& folder) const;
  void Warn(const std::string& message) const;

  std::filesystem::path root_;
  std::shared_ptr<Held> held_;
};

/// Once, with the record's own codec. @param needed  what that needs beside the record, as the parameters of a q
template <class Record, class Make, class... Needed>
Record OnceAs(const RunDirectory& directory, const Artifact& artifact, const Make& make, const Needed&... needed) {
  return Record::FromJson(directory.Once(artifact, [&] { return make().ToJson(); }), needed..., artifact.file.string());
}

}  // namespace oted
