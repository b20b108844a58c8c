#pragma once
/// Multi-start least squares on multi-step predictions: what identification tools do, here as a rival of trajectory
/// matching under the same report. Not in the paper; docs/design_methods.md says when it is enough.

#include "oted/base/fields.h"
#include "oted/stages/design/replay/replay_fit.h"

namespace oted {

/// [design.least_squares]
struct LeastSquaresConfig {
  int horizon = 2;  ///< control steps that are predicted from each logged state
  int rows = 1000;  ///< logged transitions that are predicted, at most
  int starts = 5;   ///< of the parameters: the nominal ones, then uniform draws

  FieldList Fields();
};

/// Minimises, over the parameters in the unit cube of their bounds,
///
///   sum_w sum_t,c ((o_wtc - M_c(o_w0, a_w, t; z)) / scale_c)^2
///
/// where window w is replayed from its first logged observation, taken as the exact state, and scale_c is the channel's
/// standard deviation over the logs: one variance for all channels, no unknown starts, no robust loss. A window whose
/// physics breaks down at some z costs as much as errors of ten scales throughout.
/// Levenberg-Marquardt by forward differences, with coordinates held at a bound that the descent would leave, from each
/// start; the lowest cost is kept.
///
/// The covariance is Gauss and Newton's, s^2 (J^T J)^-1 with s^2 the mean squared residual, together with the prior, so
/// that what has no effect stays as wide as it. A prior that is not uniform also draws the estimate, as it would that
/// of a linear plant: the least squares themselves know none. It holds where residuals are independent and starts
/// exact: under sensor noise it is far too narrow.
ReplayFit FitLeastSquares(const ReplayProblem& problem, const LeastSquaresConfig& config);

}  // namespace oted
