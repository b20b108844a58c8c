#pragma once
/// Where a run's artefacts lie, which of them are complete, and "make it unless it is" (docs/file_formats.md).

#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace oted {

/// One record that a stage leaves: a JSON file, and in the same folder what it tells of.
struct Artifact {
  std::filesystem::path file;
  std::string schema;
  std::string fingerprint;  ///< of everything that it depends on (oted/run/artifacts.h)
};

class RunDirectory {
 public:
  /// Of no run yet.
  RunDirectory() = default;
  /// @throws DataError when the folder cannot be made or written to.
  explicit RunDirectory(std::filesystem::path root);

  const std::filesystem::path& root() const { return root_; }
  std::filesystem::path clone() const { return root_ / "clone"; }
  std::filesystem::path design_seed(const std::string& setting, int seed) const {
    return root_ / "design" / setting / std::to_string(seed);
  }
  /// Of the methods that auto tries on part of the logs.
  std::filesystem::path trials(const std::string& setting) const { return root_ / "design" / setting / "methods"; }
  std::filesystem::path agent(int index) const { return root_ / "agents" / std::to_string(index); }
  std::filesystem::path nominal(int index) const { return root_ / "nominal" / std::to_string(index); }
  /// Of a baseline: its agents' common folder, or that of one of them.
  std::filesystem::path baseline(const std::string& name) const { return root_ / "baselines" / name; }
  std::filesystem::path baseline(const std::string& name, int index) const {
    return baseline(name) / std::to_string(index);
  }
  /// The folder's name relative to the run directory: what names its curves.
  std::string NameOf(const std::filesystem::path& folder) const;

  /// True when the artefact is there and was made from the same settings. @throws UsageError when it was made from
  /// others, or by another version: results of two configurations never mix in one directory.
  bool IsComplete(const Artifact& artifact) const;
  /// The same; and where it is not complete, checks that work which was stopped can go on (CheckCheckpoint).
  void Check(const Artifact& artifact) const;

  /// The artefact's record: read where it is complete; otherwise what `make` gives, which is written as the mark of
  /// completion. What a stopped `make` left as checkpoint.npz beside it is kept for the next call, and removed then.
  /// A record that was made is the same as one that was read.
  nlohmann::json Once(const Artifact& artifact, const std::function<nlohmann::json()>& make) const;

  /// Work that can be stopped keeps checkpoint.npz in its folder, and beside it what the work is made from.
  /// @throws UsageError when the artefact's folder holds a checkpoint of other settings.
  void CheckCheckpoint(const Artifact& artifact) const;

 private:
  /// An artefact on top of the run has no folder of its own, and so no checkpoint.
  bool HasFolder(const Artifact& artifact) const { return artifact.file.parent_path() != root_; }
  void Begin(const Artifact& artifact) const;
  void Complete(const Artifact& artifact, nlohmann::json& record) const;

  std::filesystem::path root_;
};

/// Once, with the record's own codec.
template <class Record, class Make>
Record OnceAs(const RunDirectory& directory, const Artifact& artifact, const Make& make) {
  return Record::FromJson(directory.Once(artifact, [&] { return make().ToJson(); }), artifact.file.string());
}

}  // namespace oted
