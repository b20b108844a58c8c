#pragma once
/// How far a design can be trusted.

#include <string>
#include <vector>

#include "oted/matching/designer.h"
#include "oted/matching/fit_evidence.h"

namespace oted {

enum class ParameterVerdict { kIdentified, kWeak, kNotIdentified };
enum class DesignVerdict {
  kNoGap,          ///< the nominal simulator already matches the logs
  kGapClosed,      ///< the designed simulator matches the logs
  kOutsideFamily,  ///< no simulator in this family matches the logs
};
std::string ToString(ParameterVerdict verdict);
std::string ToString(DesignVerdict verdict);

/// One parameter over the mixture of the selected setting's seeds.
struct ParameterSummary {
  double mode = 0;                                 ///< of the best-scoring seed
  double std = 0;                                  ///< of the mixture of all seeds' q
  double interval90_low = 0, interval90_high = 0;  ///< central 90 % of the mixture
  ParameterVerdict verdict = ParameterVerdict::kNotIdentified;
};

/// Summarises the mixture of `designs`; `best` is the index whose mode is reported.
/// A parameter is identified when the mixture's standard deviation is below a quarter of the prior's, weak
/// below 0.6 of it, otherwise (and without measured effect) not identified.
std::vector<ParameterSummary> SummarizeParameters(const std::vector<Designer>& designs, int best,
                                                  const std::vector<bool>& has_effect);

/// From the common score (held-out cross-entropy of a judge; log 2 where logs and simulator cannot be told apart). No
/// gap: the nominal simulator is within 0.1 nats of log 2 and the design wins less than 0.005 over it. Gap closed:
/// the designed simulator is within 0.35 nats of log 2, or has closed at least half of the gap.
DesignVerdict JudgeDesign(double nominal_common, double designed_common);

/// The channels in which windows of the log, replayed at the fitted parameters and start states, drift off: the
/// simulator lacks something that acts there. The longest windows that were tried leave more than 1.4 times the noise
/// of short ones, or more than 1.15 times where all channels together (geometric mean) do; below that chance reaches.
/// Where fewer than 0.6 of the windows are explained, contact makes long windows chaotic, and start states caught in
/// local minima drift too: there the longest windows that the estimate rests on are compared, and a quarter more is
/// allowed. Channels whose noise is less than a ten-thousandth of their spread do not count: rounding, which contact
/// magnifies.
std::vector<int> DisagreeingChannels(const FitEvidence& fit);

/// The parameters whose estimate lies within a hundredth of their range of one of its bounds, which is not where
/// their nominal value lies: what the logs ask for is beyond it.
std::vector<int> ParametersAtBounds(const Designer& q);

/// From a fit that replays windows. Outside the family: some channel disagrees, some parameter is at its bound, or the
/// logs ask something that is not searched to be other than it is (FitEvidence::suspects).
/// Otherwise the fitted simulator is as good as the logs can tell; no gap: the nominal parameters lie in the 99 %
/// region of q, widened by a hundredth of each range, which nobody would call a gap.
DesignVerdict JudgeFit(const Designer& q, const FitEvidence& fit);

/// Whether an identified parameter lies off its nominal value: by more than three of its spreads, and by more than a
/// twentieth of its range, which the seeds' errors may reach.
bool HasMoved(const ParameterSpace& space, const std::vector<ParameterSummary>& summaries);

}  // namespace oted
