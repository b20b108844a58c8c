#pragma once
/// One run before any of its stages: the settings, resolved and checked, and what they refer to.

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/config/run_config.h"
#include "oted/data/dataset.h"
#include "oted/run/design_record.h"
#include "oted/run/run_directory.h"
#include "oted/run/training_ground.h"
#include "oted/sim/simulator.h"

namespace oted {

/// The designs of one setting h.
struct SettingDesigns {
  DesignConfig config;
  std::string drawn_as;  ///< the setting that names their random streams
};

struct RunSetup {
  RunConfig config;
  RunContext context;
  Dataset dataset;
  std::unique_ptr<SimulatorFactory> factory;
  std::string model_sha256;
  std::map<std::string, SettingDesigns> settings;  ///< the design of every setting, as this simulator has it
  /// By the name of the setting that they would be: methods that may take the place of one that was left to auto.
  std::map<std::string, SettingDesigns> other_methods;
  RunDirectory directory;
  std::vector<GrowthRecord> growth = {};  ///< with design.grow: the rounds whose parameters `config` has
  std::vector<bool> has_effect = {};      ///< per parameter; empty until ParametersWithEffect measured it

  const SimulatorSpec& spec() const { return factory->spec(); }
  const ParameterSpace& parameters() const { return factory->parameters(); }
  /// Whether the design adds parameters that it lacks.
  bool grows() const { return !settings.empty() && settings.begin()->second.config.grow; }
  /// The random streams of a stage.
  RngKey Key(const std::string& stage) const { return RngKey(static_cast<uint64_t>(config.run.seed)).Stage(stage); }
  const SettingDesigns& Designs(const std::string& setting) const {
    const auto other = other_methods.find(setting);
    return other != other_methods.end() ? other->second : settings.at(setting);
  }
  /// Seeded designs of a setting.
  int NSeeds(const std::string& setting) const;
  /// Where agents train, designed simulators first.
  std::vector<Ground> Grounds() const;
  /// The folder of agent `index` (from 1) that trains there.
  std::filesystem::path AgentFolder(Ground ground, int index) const;
  /// How clones and agents act where they are judged.
  ActionNoise JudgedNoise() const;
};

/// Reads data, model and parameters, and checks everything that can be wrong with the request and with what already
/// lies in `out`; nothing is written before all of that is right. @throws UsageError, DataError
RunSetup SetUpRun(RunConfig config, const std::filesystem::path& out, RunContext context);

/// Whether each parameter changes anything that the logged episodes show; warns of one that does not.
/// @throws UsageError for such a parameter, with run.strict
const std::vector<bool>& ParametersWithEffect(RunSetup& run);

}  // namespace oted
