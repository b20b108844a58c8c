#pragma once
/// Stage 2 of a run: q(z | h_i) of every setting h and seed i.

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "oted/data/npz.h"
#include "oted/nn/policy.h"
#include "oted/run/records.h"
#include "oted/run/run_setup.h"
#include "oted/stages/design/design_problem.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

/// One seed of one setting, and what it left.
struct Design {
  std::string setting;
  int seed = 1;
  QRecord record;
  NpzArrays discriminator;              ///< empty where the method leaves none or it lies in the folder; likewise
  std::shared_ptr<const Policy> clone;  ///< that was trained jointly
};

/// Makes the clone when it is first asked for: most designs never let it act.
using CloneSource = std::function<const Policy*()>;

/// Whether the clone acts in such a design.
bool UsesClone(const RunSetup& run, const DesignConfig& config);

/// What the design of a setting's seed is given. @param clone  null where it does not act (UsesClone)
DesignProblem ProblemOf(const RunSetup& run, const std::string& setting, int seed, const Policy* clone,
                        const RunContext& context);

/// What q.json holds of a design.
QRecord RecordOf(DesignResult result, const DesignConfig& config);

/// design/SETTING/SEED: q.json, with Algorithm 1 discriminator.npz, and policy.npz where clone and design were trained
/// jointly.
/// @return all seeds of all settings
std::vector<Design> MakeDesigns(RunSetup& run, const std::map<std::string, SettingDesigns>& settings,
                                const CloneSource& clone);

/// A design as the simulator selection scores it.
Candidate AsCandidate(const RunSetup& run, const Design& design);

/// design/SETTING/SEED/prediction.json, and candidate.prediction.
void Predict(const RunSetup& run, Candidate& candidate);

}  // namespace oted
