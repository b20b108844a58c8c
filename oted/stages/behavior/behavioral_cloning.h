#pragma once
/// Stage 1 (paper, Sec. 4, step 1): learn an approximate behaviour policy mu-hat from D by behavioural cloning.

#include <memory>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"

namespace oted {

struct CloneConfig {
  std::vector<int> hidden = {256, 256};
  std::vector<int> filters = {16, 32};
  double learning_rate = 1e-3;
  double weight_decay = 1e-5;
  int batch_size = 256;
  int max_steps = 6'000;
  double held_out = 0.15;
  int patience = 10;
  int check_interval = 100;

  FieldList Fields();
};

struct CloneResult {
  std::unique_ptr<Policy> policy;  ///< a TanhGaussianPolicy, or a CategoricalPolicy where actions are discrete
  double train_loss = 0;           ///< negative log likelihood per transition, in u = atanh(a) or of the index [nats]
  double held_out_loss = 0;        ///< the same on held-out transitions, at the kept step
  int n_steps = 0;                 ///< gradient steps of the kept policy
};

/// Maximum likelihood with held-out early stopping, of a tanh-Gaussian policy:
///   minimise  mean_(s,a)~D  -log N(atanh(a); mean(s), std(s)^2),
/// or, of discrete actions, of a categorical one: -log P(a | s), with convolutions where s is an image.
/// The change of variables a = tanh(u) does not depend on the policy and is left out. Blocks of 25 consecutive
/// transitions are held out, so that held-out rows are not neighbours of training rows; the policy with the lowest
/// held-out loss is kept, and the search ends after `patience` checks without a better one.
/// @throws DataError when `dataset` does not fit `spec`, or an action is no index below spec.n_discrete_actions.
CloneResult CloneBehavior(const Dataset& dataset, const SimulatorSpec& spec, const CloneConfig& config, RngKey key,
                          const std::string& run_name, const RunContext& context);

}  // namespace oted
