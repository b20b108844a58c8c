#pragma once
/// Options that the commands share.

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

#include "oted/config/run_config.h"

namespace oted::cli {

/// As typed; empty where not given.
struct Options {
  std::string config, task, data, episodes, out, parameter_file;
  std::vector<std::string> parameters, presets, truth, assignments;
  long seed = -1;
  int threads = -1;
  int n_seeds = -1;
  std::string device;
  bool json = false, quiet = false, strict = false, grow = false, require_identified = false;
};

/// Of --task, for every verb.
inline constexpr const char* kTaskHelp =
    "simulator: Hopper-v5, HalfCheetah-v5, Walker2d-v5, their -v4 and -v2, or a world of MiniGrid; or a TOML file "
    "whose [task] describes one";

/// Adds --seed, below 0 where it is not given.
void AddSeed(CLI::App& verb, long& seed);
/// The seed of a command that has no configuration: 1 where none is given.
uint64_t SeedOf(long seed);
/// Adds --threads.
void AddThreads(CLI::App& verb, int& threads);
/// What a command makes: options of the rest are not its own.
struct Makes {
  bool designs = true, agents = true;
};
/// Adds the options of a command on a run directory.
void AddRunOptions(CLI::App& app, Options& options, const Makes& makes = {});

/// The configuration that the options describe: --config, else the run directory's own run.toml, else defaults; flags
/// on top.
RunConfig ResolveConfig(const Options& options);

/// Adds --param and --preset.
void AddParameterOptions(CLI::App& app, Options& options);
/// z of a simulator that stands for a target: the truth where it is given, nominal where it is not.
/// @throws UsageError for a truth that names no parameter
std::vector<double> TargetParameters(const ParameterSpace& space, const std::map<std::string, double>& truth);
/// " at gain 0.6, mass 2.5": those that are not nominal; empty where all are.
std::string AtParameters(const ParameterSpace& space, const std::vector<double>& z);

}  // namespace oted::cli
