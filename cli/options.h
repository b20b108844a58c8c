#pragma once
/// Options that the commands share.

#include <CLI/CLI.hpp>
#include <atomic>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cli/terminal.h"
#include "oted/report/file_sink.h"
#include "oted/run/pipeline.h"

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
    "simulator: Hopper-v5, HalfCheetah-v5, Walker2d-v5, or their -v4 and -v2; or a TOML file whose [task] describes "
    "one";

/// Adds --seed, below 0 where it is not given.
void AddSeed(CLI::App& verb, long& seed);
/// The seed of a command that has no configuration: 1 where none is given.
uint64_t SeedOf(long seed);
/// Adds --threads.
void AddThreads(CLI::App& verb, int& threads);
/// Adds the options that every stage takes.
void AddRunOptions(CLI::App& app, Options& options);
/// The settings of the named sections, of all where none is named, with types, defaults and units, for a verb's --help.
std::string SettingsHelp(const std::vector<std::string>& sections = {});

/// The configuration that the options describe: --config, else the run directory's own run.toml, else defaults; flags
/// on top.
RunConfig ResolveConfig(const Options& options);

/// Adds --param and --preset.
void AddParameterOptions(CLI::App& app, Options& options);
/// z of a simulator that stands for a target: the truth where it is given, nominal where it is not.
/// @throws UsageError for a truth that names no parameter
std::vector<double> TargetParameters(const ParameterSpace& space, const std::map<std::string, double>& truth);

/// The processor's name: what speeds in the record mean.
std::string Cpu();
/// The time, for the record: UTC, ISO 8601.
std::string Now();
/// versions.json of a run directory: which versions ran what, where and since when.
void WriteVersions(const std::filesystem::path& run_directory, const std::string& command_line,
                   const std::string& started);

/// A pipeline with its log: files in the run directory and bars on the terminal.
class Session {
 public:
  /// @param command_line for the record
  Session(const Options& options, const std::string& command_line);
  Pipeline& pipeline() { return *pipeline_; }

 private:
  TerminalSink terminal_;
  std::unique_ptr<FileSink> log_;
  std::unique_ptr<Pipeline> pipeline_;
};

/// Set by Ctrl-C; a second one ends the program at once.
extern std::atomic<bool> g_stop;
void InstallStopHandler();
/// For a command that waits for child programs: they have a grace of their own, so this program ends by itself.
void WaitForChildrenOnStop();
/// Threads and log of a command that needs no pipeline.
RunContext MakeContext(LogSink& log, int threads);

/// The program's command line, as typed.
std::string CommandLine(int argc, char** argv);

}  // namespace oted::cli
