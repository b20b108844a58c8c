#pragma once
/// Stage 2 (paper, Sec. 4.1, Algorithm 1): learn q(z) and g by distribution matching.

#include <filesystem>
#include <string>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/matching/designer.h"
#include "oted/matching/discriminator.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/design_config.h"

namespace oted {

struct DesignResult {
  Designer q;
  Discriminator g;
  double learning_progress = 0;  ///< mean reward over all iterations (Sec. 5.1's "learning progress")
};

/// Algorithm 1, for config.n_iterations:
///   1  gather experience E: for k = 1..n_sims, z_k ~ q, run mu-hat (or the logged actions) in M(z_k)
///   2  R_k = mean over E_k of -log(1 - g)
///   3  update q by Eq. 3 with reward R
///   4  update g by Eq. 2 on mini-batches of (a replay of E, D), balanced over z
/// A z whose physics broke down gets the lowest reward of the batch.
/// @param clone   may be null when config replays actions
/// @param folder  checkpoint.npz appears there every ten iterations; a stopped run goes on from it with equal results
/// @throws Interrupted when a stop was requested
DesignResult LearnDesign(const SimulatorFactory& factory, const Dataset& dataset, const TanhGaussianPolicy* clone,
                         const DesignConfig& config, RngKey key, const std::filesystem::path& folder,
                         const std::string& run_name, const RunContext& context);

}  // namespace oted
