#pragma once
/// Behavioural cloning: mu-hat by maximum likelihood.

#include <string>
#include <vector>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/stages/clone/clone.h"

namespace oted {

/// Rows of a dataset that are learned from, and those that are not.
struct CloneRowSplit {
  std::vector<int> train, held_out;
};
/// Blocks of 25 consecutive transitions are held out, so that held-out rows are not neighbours of training rows. A
/// dataset of one block is both.
CloneRowSplit SplitCloneRows(const Dataset& dataset, double held_out, Rng& rng);

/// Maximum likelihood with held-out early stopping, of a tanh-Gaussian policy:
///   minimise  mean_(s,a)~D  -log N(atanh(a); mean(s), std(s)^2),
/// or, of discrete actions, of a categorical one: -log P(a | s), with convolutions where s is an image.
/// The change of variables a = tanh(u) does not depend on the policy and is left out. The policy with the lowest
/// held-out loss is kept, and the search ends after `patience` checks without a better one. The rows are split by the
/// first draws of `job.key`.
/// @throws DataError when `job.dataset` does not fit `job.spec`, or an action is no index below its n_discrete_actions.
CloneResult CloneByLikelihood(const CloneJob& job);

/// That loss of a policy on some rows.
double LogLoss(const TanhGaussianPolicy& policy, const Dataset& dataset, const std::vector<int>& rows);

}  // namespace oted
