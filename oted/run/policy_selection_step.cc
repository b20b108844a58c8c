#include "oted/run/policy_selection_step.h"

#include <filesystem>

#include "oted/run/artifacts.h"
#include "oted/stages/policy_selection/policy_selection.h"

namespace oted {
namespace {

PolicySelectionRecord SelectAmong(const RunSetup& run, const SelectedDesign& design,
                                  const std::vector<TrainedRecord>& agents) {
  PolicySelectionJob job{.factory = *run.factory,
                         .agents = {},
                         .modes = design.record.MixtureModes(),
                         .n_episodes = run.config.agents.selection_episodes,
                         .noise = run.JudgedNoise(),
                         .key = run.Key("policy selection"),
                         .context = run.context};
  for (const TrainedRecord& agent : agents) job.agents.push_back(agent.policy.get());
  const PolicySelectionResult result = SelectPolicy(job);
  PolicySelectionRecord record;
  record.selected = result.selected + 1;
  for (const DesignRecord::Member& member : design.record.mixture) {
    record.simulators.push_back({member.seed, member.mode});
  }
  for (size_t j = 0; j < agents.size(); ++j) {
    record.agents.push_back({static_cast<int>(j) + 1, result.returns[j], result.mean_return[j], result.n_diverged[j]});
  }
  return record;
}

}  // namespace

PolicySelectionRecord SelectAgent(const RunSetup& run, const SelectedDesign& design, const Agents& agents) {
  const std::vector<TrainedRecord>& designed = agents.of.at(Ground::kDesigned);
  const std::filesystem::path path = run.directory.root() / "policy.onnx";
  const auto write = [&](const PolicySelectionRecord& record) {
    ExportPolicy(run, designed[static_cast<size_t>(record.selected - 1)], path);
  };
  const auto selection = OnceAs<PolicySelectionRecord>(run.directory, PolicySelectionArtifact(run), [&] {
    PolicySelectionRecord record = SelectAmong(run, design, designed);
    write(record);
    return record;
  });
  if (!std::filesystem::exists(path)) write(selection);
  return selection;
}

}  // namespace oted
