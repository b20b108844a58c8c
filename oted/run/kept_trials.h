#pragma once
/// What the trials of suspects have so far, on disk: a design that was stopped while they are tried goes on with it.

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "oted/run/run_directory.h"
#include "oted/stages/design/trajectories/trial_keeper.h"

namespace oted {

/// suspects.json: what the logs ask for, before any of it is tried.
struct ScreeningRecord {
  static constexpr const char* kSchema = "oted.suspects/1";
  ScreenedSuspects screened;

  nlohmann::json ToJson() const;
  static ScreeningRecord FromJson(const nlohmann::json& record, const std::string& where);
};

/// trial_NUMBER.json: one suspect, tried.
struct TrialRecord {
  static constexpr const char* kSchema = "oted.trial/1";
  TriedSuspect tried;

  nlohmann::json ToJson() const;
  static TrialRecord FromJson(const nlohmann::json& record, const std::string& where);
};

class KeptTrials : public TrialKeeper {
 public:
  /// @param of  the design whose suspects they are: they lie in its folder. Must outlive this object, as `directory`
  KeptTrials(const RunDirectory& directory, const Artifact& of) : directory_(directory), of_(of) {}

  ScreenedSuspects Screened(const std::function<ScreenedSuspects()>& make) override;
  TriedSuspect Tried(int number, const std::function<TriedSuspect()>& make) override;

  /// Once the record that tells of the suspects is there. @param folder  of the design
  static void Remove(const std::filesystem::path& folder);

 private:
  Artifact Beside(const std::string& name, const char* schema) const;

  const RunDirectory& directory_;
  const Artifact& of_;
};

}  // namespace oted
