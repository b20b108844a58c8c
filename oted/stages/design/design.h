#pragma once
/// Stage 2 (paper, Sec. 4.1): learn q(z) by one of the methods that design_method.h lists. Two of them are Algorithm 1,
/// which learns g as well.

#include <optional>

#include "oted/matching/held_out_prediction.h"
#include "oted/stages/design/design_config.h"
#include "oted/stages/design/design_problem.h"

namespace oted {

/// q(z) by the method of `config`; by Algorithm 1 also a discriminator g trained against it (the paper's score c(h) is
/// g's). The other methods take seconds to minutes and begin anew after a stop; Algorithm 1 goes on from its
/// checkpoint.
/// @throws Interrupted when a stop was requested
DesignResult LearnDesign(const DesignProblem& problem, const DesignConfig& config);

/// How q's mode predicts logs: where the method kept a part aside, what it learned from the others predicts that part;
/// else q predicts the logs that it learned from. None where no state can be set or episodes are too short.
/// @param problem  LearnDesign's
/// @param q, fit   what it gave
std::optional<HeldOutPrediction> PredictKeptAside(const DesignProblem& problem, const Designer& q,
                                                  const std::optional<FitEvidence>& fit);

}  // namespace oted
