#pragma once
/// The design by a discriminator that is told z (oted/stages/design/images/ratio_estimator.h), in two steps.
///
/// 1. g learns in simulators alone, with z uniform: Algorithm 1's lines 1 and 4. What it then says of the logs is their
///    log likelihood l(x) at the logits x of every z, whoever made them, as far as g is right.
/// 2. Experience E is gathered in M(z) and put to g in the place of the logs, and z is moved until E and the logs get
///    the same answer. What g says wrongly of both cancels, as far as the clone acts like the logs. The answer is right
///    when either is.
///
/// With delta, the difference between the answer to E and the z that it was gathered in, q is the posterior of
///   prior(x) exp(c l(x + delta)),   c = d / tr(H^-1 J),
/// where H = -E[l''] and J = Var[l'] of single samples of E: equal for a likelihood, and then c = 1; where g is too
/// sure of itself, c is smaller (the magnitude adjustment of Pauli, Racugno and Ventura 2011).

#include <functional>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/matching/designer.h"
#include "oted/matching/discriminator.h"
#include "oted/matching/experience.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/images/images_config.h"

namespace oted {

/// Called after each iteration with q as it stands and g's mean loss.
using RatioProgress = std::function<void(int iteration, const Designer& q, double loss)>;

/// What a design by ratios is given. What it refers to must outlive it.
struct RatioProblem {
  const SimulatorFactory& factory;
  const Dataset& dataset;
  const Policy* clone;  ///< null where logged actions are replayed
  EvidenceConfig evidence;
  const Designer& prior;  ///< the kind of q, and its parameters
  RngKey key;
  const RatioProgress& progress;
  const RunContext& context;
};

/// @param g  network, batches and step sizes of the discriminator
/// @throws DataError when nearly all simulators of the range diverge; Interrupted
Designer MatchRatios(const RatioProblem& problem, const ImagesConfig& config, const DiscriminatorConfig& g);

}  // namespace oted
