#include "oted/run/provenance.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "oted/base/files.h"
#include "oted/sim/mujoco/model_task.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

/// The model file, its task file and the compiled model.
void KeepModel(const RunSetup& run) {
  if (!run.config.task.has_model()) return;
  const fs::path folder = run.directory.root() / "model", file = FindModelFile(run.config.task.model.model);
  TaskConfig kept = run.config.task;
  kept.model.model = file.filename().string();
  WriteFileAtomically(folder / file.filename(), ReadFile(file));
  WriteFileAtomically(folder / "task.toml", kept.ToToml());
  WriteFileAtomically(folder / "compiled.mjb", CompileToMjb(run.config.task.model));
}

/// As in every configuration file, paths are relative to the file's own folder.
void WriteConfig(const RunSetup& run) {
  const fs::path& root = run.directory.root();
  RunConfig written = run.config;
  written.data.path = fs::proximate(run.config.data.path, root).string();
  std::string& model = written.task.model.model;
  if (!model.empty() && !model.starts_with("package:")) model = fs::proximate(model, root).string();
  const auto place_prior = [&](DesignChoice& design) {
    const std::string prior = design.Assumed().prior;
    if (prior == "uniform" || prior == "gaussian") return;
    design.Set("prior", fs::proximate(prior, root).string(), "design");
  };
  place_prior(written.design);
  for (auto& [unused, setting] : written.settings) place_prior(setting);
  WriteFileAtomically(root / "run.toml", written.ToToml());
}

}  // namespace

void WriteProvenance(const RunSetup& run) {
  KeepModel(run);
  WriteConfig(run);
  const Dataset& dataset = run.dataset;
  WriteJson(run.directory.root() / "dataset.json", {{"schema", "oted.dataset/1"},
                                                    {"path", run.config.data.path},
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
                                                    {"warnings", dataset.warnings}});
}

}  // namespace oted
