#pragma once
/// Algorithm 1 of the paper (Sec. 4.1): q(z) by policy gradient against a discriminator g.

#include "oted/stages/design/adversarial/adversarial_config.h"
#include "oted/stages/design/design_problem.h"

namespace oted {

/// Algorithm 1, for config.n_iterations:
///   1  gather experience E: for k = 1..n_sims, z_k ~ q, run mu-hat (or the logged actions) in M(z_k)
///   2  R_k = mean over E_k of -log(1 - g)
///   3  update q by Eq. 3 with reward R
///   4  update g by Eq. 2 on mini-batches of (a replay of E, D), balanced over z
/// and, with config.clone_updates (joint training, docs/deviations.md#joint-training):
///   5  update mu-hat by ValueDICE, with a replay of E's steps beside the logs (joint_clone.h)
/// A z whose physics broke down gets the lowest reward of the batch.
/// @param start  q of the first iteration
DesignResult LearnAdversarially(const DesignProblem& problem, const AdversarialConfig& config,
                                const DiscriminatorConfig& discriminator, const Designer& start);

}  // namespace oted
