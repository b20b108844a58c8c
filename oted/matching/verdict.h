#pragma once
/// How far a design can be trusted.

#include <cmath>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/matching/designer.h"
#include "oted/matching/held_out_prediction.h"

namespace oted {

enum class ParameterVerdict {
  kIdentified,
  kWeak,
  kNotIdentified,
  kAtBound,  ///< the logs ask for a value at the end of the range, or beyond it
};
enum class DesignVerdict {
  kNoGap,          ///< the nominal simulator predicts the logs as well as the sensors let it
  kGapClosed,      ///< the designed simulator does, the nominal one does not
  kGapNarrowed,    ///< the designed simulator predicts better than the nominal one; more is left than sensors explain
  kOutsideFamily,  ///< no simulator in this family predicts better than the nominal one, or none within the bounds
  kUndecided,      ///< the logs show too little to tell
};
/// Whether nothing speaks for using the design as it is.
constexpr bool IsNegative(DesignVerdict verdict) {
  return verdict == DesignVerdict::kOutsideFamily || verdict == DesignVerdict::kUndecided;
}
/// Whether that is no gap or a closed one.
constexpr bool FloorIsReached(DesignVerdict verdict) {
  return verdict == DesignVerdict::kNoGap || verdict == DesignVerdict::kGapClosed;
}
std::string ToString(ParameterVerdict verdict);
std::string ToString(DesignVerdict verdict);
const NamedValues<ParameterVerdict>& ParameterVerdictNames();
const NamedValues<DesignVerdict>& DesignVerdictNames();

/// One parameter over the mixture of the selected setting's seeds.
struct ParameterSummary {
  double mode = 0;  ///< of the best-scoring seed
  double std = 0;   ///< of the mixture of all seeds' q; as wide as the interval's where that was opened
  double interval90_low = 0, interval90_high = 0;  ///< central 90 % of the mixture
  ParameterVerdict verdict = ParameterVerdict::kNotIdentified;
};

inline constexpr double kIntervalMass = 0.9;  ///< of q, in every interval that is told

/// Summarises the mixture of `designs`; `best` is the index whose mode is reported. Widths are those of the central 90
/// % interval on the scale of the search (the logarithm where the parameter has log), in widths of the prior's. A
/// parameter is at its bound when the interval reaches a hundredth of the range from an end of it (EndsAtBound),
/// identified when it is narrower than a quarter of the prior's, weak below 0.6, otherwise not identified. Without
/// measured effect nothing is identified. Where the family is rejected nothing is more than weak, nor is a parameter of
/// which another design that predicts as well has a value outside its interval, nor a multiple, or a quantity that the
/// model has as 0, whose interval's ends differ by more than a factor of 1.5.
/// @param reaches_floor  the design explains the logs (DesignVerdict is kNoGap or kGapClosed)
/// @param open_ends      where intervals go to the end of the range: predictions do not tell
/// @param otherwise      intervals by other designs that predict as well, held by what is told; none: low above high
std::vector<ParameterSummary> SummarizeParameters(const std::vector<Designer>& designs, int best,
                                                  const std::vector<bool>& has_effect, bool reaches_floor,
                                                  const std::vector<HeldOutPrediction::OpenEnd>& open_ends = {},
                                                  const std::vector<std::vector<SearchInterval>>& otherwise = {});

/// The parameters that q alone would call identified: what predictions then have to bear out.
std::vector<int> NarrowParameters(const Designer& q);

/// Whether a value (or an interval) of a parameter ends at a bound: within a hundredth of the range, on the scale of
/// the search. A lower bound of zero is none where friction or damping cannot be less; nor is a bound where the nominal
/// value lies itself.
bool EndsAtBound(const ParameterSpec& spec, double low, double high);

/// What the fit says against a design, beside how well it predicts.
struct FitDoubts {
  /// Parameters that ended at a bound: of ParametersAtBounds(q), those that no other explanation of the logs leaves
  /// open.
  std::vector<int> at_bounds = {};
  /// The fit that leaves a recording out predicts it surely worse than the nominal simulator.
  bool fails_in_a_recording = false;
  bool asks_for_more = false;  ///< the logs surely ask for something that is not searched
};

/// From held-out prediction, where states can be set:
///
///   no_gap          the floor is reached, and the nominal simulator does as well: its parameters lie in the 99 %
///                   region of q, widened by a hundredth of each range, or the design gains nothing noticeable: at no
///                   horizon a tenth (of mean squares). Or the nominal simulator alone reaches the floor, and not in a
///                   few brief windows alone (FollowsAFewWindows)
///   gap_closed      the floor is reached
///   gap_narrowed    it is not, but the design surely predicts better than the nominal simulator
///   outside_family  more is left than sensors explain, and it does not, or a parameter ended at a bound: the logs ask
///                   for what the family does not have
///   undecided       nothing of it is sure: the logs show too little, or nothing at all (ShowsNothing)
///
/// Under noise predictions may reach the floor though something else is off: the fit's windows tell more. Where they
/// ask for more, the verdict is gap_narrowed or outside_family; where the fit fails in a recording, no gap is closed.
DesignVerdict JudgePrediction(const Designer& q, const HeldOutPrediction& prediction, const FitDoubts& doubts);

/// Whether an error is no less than that of a guess (but for a tenth).
bool IsNoBetterThanGuess(double error, double guess);
/// Whether at no horizon the design's error in the judged channels, in their geometric mean, is below that of guesses.
/// Horizons over logs that it learned from count where no others can judge.
/// @param horizons  each with `learned` and channels, each with `judged`, `designed` and `guess`
/// @param times     so many times the guesses' error
template <class Horizons>
bool GuessesAsWell(const Horizons& horizons, double times = 1) {
  bool all_learned = true;
  for (const auto& horizon : horizons) all_learned = all_learned && horizon.learned;
  for (const auto& horizon : horizons) {
    if (horizon.learned && !all_learned) continue;
    double log_ratio = 0;
    bool asked = false;
    for (const auto& channel : horizon.channels) {
      if (!channel.judged || !(channel.guess > 0)) continue;
      asked = true;
      log_ratio += std::log(channel.designed / (times * channel.guess));
    }
    if (!asked || log_ratio < 0) return false;
  }
  return true;
}
inline constexpr double kMostlyNoise = 0.5;  ///< of a channel's spread: what the sensors leave where they show nothing
/// Whether the logs show nothing that a simulator could be judged by: at no horizon and in no channel does one predict
/// better than the channel's mean, nor would one that is right. A robot at rest with noisy sensors, readings at random.
/// The floor means nothing there: noise as large as the readings explains everything.
/// @param horizons  each with channels, each with `judged`, `nominal`, `designed`, `floor` and `spread`
template <class Horizons>
bool ShowsNothing(const Horizons& horizons) {
  for (const auto& horizon : horizons) {
    for (const auto& c : horizon.channels) {
      const bool guesses = IsNoBetterThanGuess(c.nominal, c.spread) && IsNoBetterThanGuess(c.designed, c.spread) &&
                           c.floor >= kMostlyNoise * c.spread;
      if (c.judged && !guesses) return false;
    }
  }
  return true;
}

inline constexpr double kLeastLearned_s = 5;  ///< of windows
inline constexpr int kFewestLearned = 10;     ///< windows, where time has no unit
/// Whether all that judges are a few brief windows of noisy logs that the design learned from: its parameters and their
/// starts follow so little wherever the truth lies, so that no reached floor proves anything. Exact readings are not
/// followed by chance.
/// @param horizons  as ToldOf; each with channels, each with `judged`, `floor` and `spread`
template <class Horizons>
bool FollowsAFewWindows(const Horizons& horizons) {
  const auto& told = ToldOf(horizons);
  if (!told.learned) return false;
  bool are_noisy = false;
  for (const auto& c : told.channels) are_noisy = are_noisy || (c.judged && c.floor > kVisibleError * c.spread);
  return are_noisy &&
         (told.seconds > 0 ? told.n_windows * told.seconds < kLeastLearned_s : told.n_windows < kFewestLearned);
}

/// Whether the windows would show an error half as large again as the floor's, over all horizons up to half a second
/// (the shortest, where time has no unit), and do not, in sum. Where they are too few, or some are far off and others
/// are not, chance hides as much: that the floor is reached is not known. Nor is it where FollowsAFewWindows.
bool IsFloorTold(const HeldOutPrediction& prediction);
/// @param most_times_floor  MostTimesFloor
inline bool TellsFloor(double most_times_floor) { return most_times_floor < 1.5; }
/// Whether what the design leaves is what the sensors leave: at no horizon is the excess over the floor both noticeable
/// and beyond chance, the windows would show it (IsFloorTold), and no episode is surely farther off. Over all channels
/// together: more than a tenth (of mean squares) and 2.5 standard errors; in one channel: more than half and four
/// standard errors. Logs that show nothing (ShowsNothing) have no floor to reach. Nor has a design whose error is over
/// a tenth larger than that of guesses at every horizon: its own logs were as uncertain.
bool ReachesFloor(const HeldOutPrediction& prediction);
/// Whether the nominal simulator does: a design of little data can predict worse. No standard error excuses it.
bool NominalReachesFloor(const HeldOutPrediction& prediction);
/// Whether neither does, in logs that show something: then there is something to find.
bool LeavesGap(const HeldOutPrediction& prediction);
/// The channels in which the design leaves more than the floor, the farthest off first; all horizons count. Where all
/// channels together are off and none alone, the one with the largest excess. None where the logs show nothing.
std::vector<int> ChannelsOff(const HeldOutPrediction& prediction);
/// Whether an error is surely smaller: by a twentieth (of mean squares) and by two standard errors.
bool IsSure(const Estimated& gain);
/// Whether it is surely larger.
bool IsSureLoss(const Estimated& gain);
/// Whether what is compared at a horizon surely predicts worse than the design: over all channels, or in one.
bool IsSurelyWorse(const HeldOutPrediction::Horizon& compared);
/// Whether the design surely predicts better over this horizon: by sums over its windows, or in a typical window while
/// the sums are better as well. One seam of a log fills a sum with what no simulator does.
bool IsSurelyBetter(const HeldOutPrediction::Horizon& compared);
/// Whether the design surely predicts better than the nominal simulator: at some horizon, and at none surely worse,
/// neither in all windows nor in the recordings that were kept aside whole. It is sure in all windows; or in those
/// recordings alone, and all windows are better. Logs that it learned from count for it only where no others can judge.
bool PredictsBetter(const HeldOutPrediction& prediction);
/// Whether it surely predicts worse at some horizon, in all windows or in whole recordings.
bool PredictsWorse(const HeldOutPrediction& prediction);

/// Whether a judge of this common score (held-out cross-entropy; log 2 where logs and simulator cannot be told apart)
/// hardly tells them apart: it is within 0.1 nats of log 2.
bool CannotTell(double common);

/// Transitions that a classifier needs before its verdict says anything.
inline constexpr int kFewestJudged = 50;

/// From the common score, where nothing can be predicted. Fewer than kFewestJudged transitions: undecided. No gap: the
/// nominal simulator is within 0.1 nats of log 2 and the design wins less than 0.005 over it. Gap closed: the designed
/// simulator is within 0.1 nats of log 2. Gap narrowed: it wins a tenth of the gap. Otherwise outside the family.
DesignVerdict JudgeDesign(double nominal_common, double designed_common, int n_transitions);

/// What a value of a parameter has to change by for that to be told: a twentieth of it. Of a value that may be none,
/// such as a friction that the model lacks, that is at least a five hundredth of its range; of one with a size of its
/// own (control steps, readings, angles of gravity) it is a hundredth.
double SmallChange(const ParameterSpec& spec, double z);

/// The parameters whose estimate lies at one of its bounds (EndsAtBound): what the logs ask for is beyond it. One that
/// the logs hardly tell is none, wherever it ended.
std::vector<int> ParametersAtBounds(const Designer& q);

/// Whether a value lies off the nominal one: by more than three of its standard deviations, and by more than a
/// twentieth of its range, which the seeds' errors may reach.
/// @param range  its length
bool LiesOff(double mode, double nominal, double std, double range);
/// What is not borne out is at most weak: a value that LiesOff the nominal one where predictions are as good by that,
/// and those that are `unsettled` (FitEvidence).
/// @param can_tell  predictions tell the design from the nominal simulator, or there are none
void WeakenDoubted(const ParameterSpace& space, bool can_tell, const std::vector<int>& unsettled,
                   std::vector<ParameterSummary>& summaries);
/// Whether an identified parameter lies off its nominal value.
bool HasMoved(const ParameterSpace& space, const std::vector<ParameterSummary>& summaries);

}  // namespace oted
