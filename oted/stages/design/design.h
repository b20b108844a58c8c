#pragma once
/// Stage 2 (paper, Sec. 4.1, Algorithm 1): learn q(z) and g by distribution matching.

#include <filesystem>
#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/matching/designer.h"
#include "oted/matching/discriminator.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/design_config.h"

namespace oted {

struct DesignResult {
  Designer q;
  Discriminator g;
  double learning_progress = 0;   ///< mean reward over all iterations (Sec. 5.1's "learning progress")
  std::vector<double> noise_std;  ///< (obs_dim) of the logged observations, where the form estimates it; else empty
};

/// q(z) by the form that `config` names, and a discriminator g trained against it (the paper's score c(h) is g's):
///   "trajectories"          MatchTrajectories, then lines 1, 2 and 4 of Algorithm 1 with that q
///   "transitions", "paper"  Algorithm 1
/// @param config  resolved: its form is not "auto"
/// @param clone   may be null when config replays actions
/// @param folder  Algorithm 1 leaves checkpoint.npz there every ten iterations; a stopped run goes on from it with
/// equal
///                results. Trajectory matching, which takes seconds, begins anew
/// @throws Interrupted when a stop was requested
DesignResult LearnDesign(const SimulatorFactory& factory, const Dataset& dataset, const Policy* clone,
                         const DesignConfig& config, RngKey key, const std::filesystem::path& folder,
                         const std::string& run_name, const RunContext& context);

}  // namespace oted
