#pragma once
/// Where a run's artefacts lie, and which of them are complete (docs/file_formats.md).

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "oted/sim/parameter_space.h"

namespace oted {

class RunDirectory {
 public:
  /// @throws DataError when the folder cannot be made or written to.
  explicit RunDirectory(std::filesystem::path root);

  const std::filesystem::path& root() const { return root_; }
  std::filesystem::path clone() const { return root_ / "clone"; }
  std::filesystem::path design_seed(const std::string& setting, int seed) const {
    return root_ / "design" / setting / std::to_string(seed);
  }
  std::filesystem::path agent(int index) const { return root_ / "agents" / std::to_string(index); }
  std::filesystem::path undesigned(int index) const { return root_ / "undesigned" / std::to_string(index); }
  /// Of a baseline: its agents' common folder, or that of one of them.
  std::filesystem::path baseline(const std::string& name) const { return root_ / "baselines" / name; }
  std::filesystem::path baseline(const std::string& name, int index) const {
    return baseline(name) / std::to_string(index);
  }
  /// The folder's name relative to the run directory: what names its curves.
  std::string NameOf(const std::filesystem::path& folder) const;

  /// True when `file` (JSON) exists and was made from the same settings. @throws UsageError when it was made from
  /// others: results of two configurations never mix in one directory.
  bool IsComplete(const std::filesystem::path& file, const std::string& fingerprint) const;
  /// Writes `result` with its fingerprint: the mark of completion.
  void Complete(const std::filesystem::path& file, nlohmann::json result, const std::string& fingerprint) const;

  /// A unit of work that can be stopped keeps checkpoint.npz in its folder, and beside it what the work is made from.
  /// @throws UsageError when `folder` holds a checkpoint of other settings.
  void CheckCheckpoint(const std::filesystem::path& folder, const std::string& fingerprint) const;
  /// Call before the unit's work: CheckCheckpoint, and the mark of what is being made.
  void Begin(const std::filesystem::path& folder, const std::string& fingerprint) const;
  /// Call after Complete: the checkpoint has done its service.
  void RemoveCheckpoint(const std::filesystem::path& folder) const;

 private:
  std::filesystem::path root_;
};

/// A short name for everything that a result depends on.
std::string Fingerprint(const nlohmann::json& inputs);

/// What parameters are, for fingerprints.
nlohmann::json ParameterIdentity(const ParameterSpace& space);

}  // namespace oted
