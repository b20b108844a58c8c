#pragma once
/// Stage 2 of a run: q(z | h_i) of every setting h and seed i.

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "oted/data/npz.h"
#include "oted/nn/policy.h"
#include "oted/run/records.h"
#include "oted/run/run_setup.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

/// One seed of one setting, and what it left.
struct Design {
  std::string setting;
  int seed = 1;
  QRecord record;
  NpzArrays discriminator;              ///< empty where it lies in the folder from an earlier call; likewise
  std::shared_ptr<const Policy> clone;  ///< that was trained jointly
};

/// design/SETTING/SEED: q.json, discriminator.npz, and policy.npz where clone and design were trained jointly.
/// @return all seeds of all settings
std::vector<Design> MakeDesigns(RunSetup& run, const std::map<std::string, SettingDesigns>& settings,
                                const Policy& clone);

/// A design as the simulator selection scores it.
Candidate AsCandidate(const RunSetup& run, const Design& design);

}  // namespace oted
