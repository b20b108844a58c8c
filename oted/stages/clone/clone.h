#pragma once
/// Stage 1 (paper, Sec. 4, step 1): learn an approximate behaviour policy mu-hat from D.

#include <memory>
#include <optional>
#include <string>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"
#include "oted/stages/clone/clone_config.h"

namespace oted {

/// What `auto` knows of one method's policy, learned without the held-out episodes.
struct MethodEvidence {
  double held_out_loss = 0;         ///< negative log likelihood of the held-out episodes' actions [nats per transition]
  std::optional<double> closeness;  ///< how hard its rollouts in the nominal simulator are to tell from the logs
                                    ///< [nats]: a judge's held-out loss, log 2 where it cannot
};

struct CloneChoice {
  MethodEvidence bc, valuedice;
  int n_held_out = 0;  ///< transitions
  std::string reason;  ///< a sentence
};

struct CloneResult {
  std::unique_ptr<Policy> policy;  ///< a TanhGaussianPolicy, or a CategoricalPolicy where actions are discrete
  double train_loss = 0;           ///< negative log likelihood per transition, in u = atanh(a) or of the index [nats]
  double held_out_loss = 0;        ///< the same on held-out transitions, at the kept step
  int n_steps = 0;                 ///< gradient steps of the kept policy
  CloneMethod method = CloneMethod::kBehavioralCloning;  ///< that was used; never kAuto
  std::optional<CloneChoice> choice;                     ///< of clone.method = "auto"
};

/// What is imitated and how, and where the curves go.
struct CloneJob {
  const Dataset& dataset;
  const SimulatorSpec& spec;
  const CloneConfig& config;
  RngKey key;
  std::string run_name;  ///< of its curves in the log
  RunContext context;
  const SimulatorFactory* nominal = nullptr;  ///< in which `auto` lets its two clones act, at nominal; may be null
};

/// The clone by `job.config.method`: CloneByLikelihood, CloneByValueDice, or what ChooseClone finds.
/// @throws DataError when `dataset` does not fit `spec`, or an action is no index below spec.n_discrete_actions;
///         UsageError for ValueDICE of discrete actions or images; Interrupted when a stop was requested
CloneResult CloneBehavior(const CloneJob& job);

}  // namespace oted
