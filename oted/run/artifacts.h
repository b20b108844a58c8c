#pragma once
/// The one list of what a run leaves: each artefact's file, schema, and fingerprint of everything that it depends on.

#include <string>
#include <vector>

#include "oted/run/run_directory.h"
#include "oted/run/run_setup.h"

namespace oted {

/// clone/clone.json
Artifact CloneArtifact(const RunSetup& run);
/// growth/ROUND/growth.json, by the parameters that the run has before that round
Artifact GrowthArtifact(const RunSetup& run, int round);
/// growth/ROUND/design/q.json: the design of that round
Artifact GrowthDesignArtifact(const RunSetup& run, int round);
/// growth/ROUND/design/prediction.json
Artifact GrowthPredictionArtifact(const RunSetup& run, int round);
/// design/SETTING/SEED/q.json
Artifact DesignArtifact(const RunSetup& run, const std::string& setting, int seed);
/// design/SETTING/SEED/prediction.json: of the designs that verdicts are about
Artifact PredictionArtifact(const RunSetup& run, const std::string& setting, int seed);
/// design/SETTING/methods/METHOD/q.json: a method tried on part of the logs
Artifact TrialArtifact(const RunSetup& run, const std::string& setting, const DesignConfig& design);
/// design/SETTING/methods/choice.json
Artifact MethodChoiceArtifact(const RunSetup& run, const std::string& setting);
/// design.json
Artifact SelectionArtifact(const RunSetup& run);
/// motion/replay.json, for the report
Artifact ReplayArtifact(const RunSetup& run);
/// motion/motion.json, likewise
Artifact FilmArtifact(const RunSetup& run);
/// agents/1/agent.json, or that of an agent to compare with
Artifact AgentArtifact(const RunSetup& run, Ground ground, int index);
/// baselines/bc_dr/clone.json
Artifact BcDrArtifact(const RunSetup& run);
/// baselines/NAME/offline.json
Artifact OfflineArtifact(const RunSetup& run, OfflineBaseline baseline);
/// policy_selection.json
Artifact PolicySelectionArtifact(const RunSetup& run);
/// evaluation.json
Artifact EvaluationArtifact(const RunSetup& run);

/// Everything that a run of these settings may leave and that must not be of others. Rounds of growth are not among
/// them: what they find changes the settings (growth_step.h).
std::vector<Artifact> AllArtifacts(const RunSetup& run);

}  // namespace oted
