#include "oted/run/provenance.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/stages/design/prior_source.h"

namespace oted {

using nlohmann::json;
namespace fs = std::filesystem;

namespace {

constexpr const char* kConfig = "run.toml";

/// Nothing is written where it is there already.
void Keep(const fs::path& path, const std::string& bytes) {
  std::error_code error;
  if (fs::is_regular_file(path, error) && fs::file_size(path, error) == bytes.size() && ReadFile(path) == bytes) return;
  WriteFileAtomically(path, bytes);
}

void KeepSealed(const fs::path& path, json record, const std::vector<std::string>& files) {
  Seal(record, path.parent_path(), files);
  Keep(path, record.dump(2, ' ', false, json::error_handler_t::replace) + "\n");
}

/// The model file, its task file and the compiled model.
void KeepModel(const RunSetup& run) {
  if (!run.config.task.has_model()) return;
  const fs::path folder = run.directory.root() / "model", file = FindModelFile(run.config.task.model.model);
  TaskConfig kept = run.config.task;
  kept.model.model = file.filename().string();
  Keep(folder / file.filename(), ReadFile(file));
  Keep(folder / "task.toml", kept.ToToml());
  Keep(folder / "compiled.mjb", CompileToMjb(run.config.task.model));
  KeepSealed(folder / "model.json", {{"schema", "oted.model/1"}, {"sha256", run.model_sha256}},
             {file.filename().string(), "task.toml", "compiled.mjb"});
}

/// What was asked: parameters that grew are told by the records of their rounds.
RunConfig AskedConfig(const RunSetup& run) {
  RunConfig asked = run.config;
  for (const GrowthRecord& round : run.growth) {
    const Suspect* freed = round.Freed();
    if (freed == nullptr) continue;
    asked.parameters.pop_back();
    asked.truth.erase(freed->spec.name);
    if (!asked.agents.nominal_at.empty()) asked.agents.nominal_at.pop_back();
  }
  return asked;
}

/// As in every configuration file, paths are relative to the file's own folder.
void WriteConfig(const RunSetup& run) {
  const fs::path& root = run.directory.root();
  RunConfig written = AskedConfig(run);
  const auto place = [&](std::string& path) {
    if (!path.empty()) path = fs::proximate(path, root).string();
  };
  place(written.data.path);
  for (DataConfig::Recording& recording : written.data.recordings) place(recording.path);
  std::string& model = written.task.model.model;
  if (!model.empty() && !model.starts_with("package:")) model = fs::proximate(model, root).string();
  const auto place_prior = [&](DesignChoice& design) {
    const std::string prior = design.Assumed().prior;
    if (PriorSourceOf(prior) != PriorSource::kDesign) return;
    design.Set("prior", fs::proximate(prior, root).string(), "design");
  };
  place_prior(written.design);
  for (auto& [unused, setting] : written.settings) place_prior(setting);
  Keep(root / kConfig, SealedText(written.ToToml(), "of what follows; an edited file is run with CONFIG, its name"));
}

}  // namespace

void WriteProvenance(const RunSetup& run) {
  KeepModel(run);
  WriteConfig(run);
  const Dataset& dataset = run.dataset;
  KeepSealed(run.directory.root() / "dataset.json",
             {{"schema", "oted.dataset/1"},
              {"path", run.config.data.Files()},
              {"sha256", dataset.sha256},
              {"n_transitions", dataset.size()},
              {"n_episodes", dataset.Episodes().size()},
              {"episode_returns", dataset.EpisodeReturns()},
              {"obs_dim", dataset.obs_dim()},
              {"act_dim", dataset.act_dim()},
              {"observation_names", dataset.observation_names},
              {"action_names", dataset.action_names},
              {"period_s", dataset.period_s},
              {"remarks", dataset.remarks},
              {"warnings", dataset.warnings}},
             {});
}

std::vector<std::string> ChangedSettings(const RunSetup& run) {
  json kept;
  try {
    kept = ReadKeptConfig(run.directory.root()).ToJson().flatten();
  } catch (const Error&) {
    return {};
  }
  const json now = AskedConfig(run).ToJson().flatten();
  std::set<std::string> names;
  for (const auto& [name, unused] : kept.items()) names.insert(name);
  for (const auto& [name, unused] : now.items()) names.insert(name);
  std::vector<std::string> changed;
  for (const std::string& name : names) {
    const bool is_file = name.starts_with("/data/") || name.starts_with("/task/") || name.ends_with("/prior");
    const bool is_no_result = name.starts_with("/report/") || name == "/run/threads";
    if (is_file || is_no_result || kept.value(name, json()) == now.value(name, json())) continue;
    const auto text = [&](const json& settings) {
      return settings.contains(name) ? settings.at(name).dump() : std::string("not set");
    };
    std::string dotted = name.substr(1);
    std::ranges::replace(dotted, '/', '.');
    changed.push_back(fmt::format("{} = {} (was {})", dotted, text(now), text(kept)));
  }
  return changed;
}

RunConfig ReadKeptConfig(const fs::path& run_directory) {
  const fs::path file = run_directory / kConfig;
  const std::string path = file.string();
  const std::string remedy =
      fmt::format("if you edited it, name it as the configuration: oted run {} --out {}", path, run_directory.string());
  RunConfig config = RunConfig::FromToml(ReadSealedText(file, remedy), path);
  // A run that was moved, or whose model was, has a copy of its own.
  std::string& model = config.task.model.model;
  if (!model.empty() && !model.starts_with("package:") && !fs::exists(model)) {
    const fs::path kept = run_directory / "model" / fs::path(model).filename();
    if (fs::exists(kept)) model = kept.string();
  }
  return config;
}

}  // namespace oted
