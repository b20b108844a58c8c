#include "oted/matching/verdict.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "oted/base/bisection.h"
#include "oted/base/error.h"
#include "oted/sim/channel_path.h"

namespace oted {
namespace {

constexpr double kIdentifiedBelow = 0.25;  // of the prior's interval
constexpr double kWeakBelow = 0.6;
constexpr double kLoose = 1.5;                              // times: between the ends of an interval
constexpr double kNextToNothing = 0.1;                      // of the model's value
constexpr double kNextToNothingOfRange = 0.002;             // where that is 0
constexpr double kSmallShare = 0.05, kSmallOfRange = 0.01;  // of a value, of its range
constexpr double kNoGapMargin = 0.1;                        // nats of the common score
constexpr double kNoGainMargin = 0.005;                     // nats that a design must win over the nominal simulator
constexpr double kNarrowedShare = 0.1;                      // of the gap in nats
constexpr double kNoticeable = 0.04;                        // in x: a hundredth of the range at its middle
constexpr double kMovedAbove = 0.05;                        // of the range
constexpr double kAtBound = 0.01;                           // of the range
constexpr double kWidthOfInterval = 3.29;  // standard deviations, of a normal distribution's central 90 %

// Logarithms of ratios of mean squares, and standard errors.
constexpr double kLeastExcess = 0.1, kExcessErrors = 2.5;
constexpr double kLeastChannelExcess = 0.4, kChannelExcessErrors = 4.0;
constexpr double kLeastGain = 0.05, kGainErrors = 2.0;
constexpr double kGuess = 0.9;         // of a channel's spread
constexpr double kFarFromGuess = 1.1;  // times a guess's error

bool IsExcess(const Estimated& e) { return e.value > std::max(kLeastExcess, kExcessErrors * e.error); }
bool IsChannelExcess(const Estimated& e) {
  return e.value > std::max(kLeastChannelExcess, kChannelExcessErrors * e.error);
}

/// z at which the mixture of distributions on a grid has the given cumulative probability for parameter i.
double GridMixtureQuantile(const std::vector<Designer>& designs, size_t i, double probability) {
  const ParameterSpec& spec = designs[0].space()[static_cast<int>(i)];
  return Bisect(spec.low, spec.high, 60, [&](double z) {
    double mass = 0;
    for (const Designer& q : designs) {
      mass += q.Cumulative(static_cast<int>(i), z) / static_cast<double>(designs.size());
    }
    return mass < probability;
  });
}

/// x at which the mixture of Gaussians of parameter i has the given cumulative probability; by bisection.
double MixtureQuantile(const std::vector<Designer>& designs, size_t i, double probability) {
  return Bisect(-20, 20, 60, [&](double x) {
    double mass = 0;
    for (const Designer& q : designs) {
      const double noise = (x - q.mean()[i]) / std::exp(q.log_std()[i]);
      mass += 0.5 * std::erfc(-noise / std::numbers::sqrt2) / static_cast<double>(designs.size());
    }
    return mass < probability;
  });
}

double ZOf(const Designer& q, size_t i, double x) {
  std::vector<double> all(static_cast<size_t>(q.size()), 0.0);
  all[i] = x;
  return LogitToZ(q.space(), all)[i];
}

/// z of one parameter on the scale of its search.
double UnitOf(const ParameterSpec& spec, double z) { return ParameterSpace({spec}).ToUnit(std::vector<double>{z})[0]; }

double UnitWidth(const ParameterSpec& spec, double low, double high) { return UnitOf(spec, high) - UnitOf(spec, low); }

/// Of the prior's central interval, in u. What the prior knew already the logs did not tell.
double PriorWidth(const Designer& q, int p) {
  if (q.prior().uniform) return kIntervalMass;
  Designer prior = q;
  prior.StartAtPrior(Designer::kPriorStd);
  const Designer::Interval interval = prior.CentralInterval(kIntervalMass)[static_cast<size_t>(p)];
  return UnitWidth(q.space()[p], interval.low, interval.high);
}

/// Whether q's interval of a parameter is narrower than that share of the prior's.
bool IsNarrower(const Designer& q, int p, double share) {
  const Designer::Interval interval = q.CentralInterval(kIntervalMass)[static_cast<size_t>(p)];
  return UnitWidth(q.space()[p], interval.low, interval.high) < share * PriorWidth(q, p);
}

/// Whether a value is no share of another: control steps, seconds, readings, a direction of gravity.
bool HasOwnSize(const ParameterSpec& spec) {
  return (!spec.IsMultiple() && spec.nominal != 0) || spec.low < 0 || (IsChannelPath(spec.field) && !spec.IsMultiple());
}

/// Whether a value is known to no more than half of itself. Not asked of what may be negative, of a sensor's or a
/// command's own number, and of what is next to nothing: beside the model's value, or beside the range.
bool IsLoose(const ParameterSpec& spec, const ParameterSummary& summary) {
  if (spec.low < 0 || (IsChannelPath(spec.field) && !spec.IsMultiple())) return false;
  const double low = summary.interval90_low, high = summary.interval90_high;
  const double next_to_nothing = spec.IsMultiple() ? kNextToNothing
                                                   : std::max(kNextToNothing * std::abs(spec.nominal),
                                                              kNextToNothingOfRange * (spec.high - spec.low));
  return high > kLoose * low && high - low > next_to_nothing;
}

/// @param at_bound  the interval that q gives ends at one
ParameterVerdict VerdictOf(const ParameterSpec& spec, const ParameterSummary& summary, double prior_width,
                           bool at_bound) {
  const double width = UnitWidth(spec, summary.interval90_low, summary.interval90_high) / prior_width;
  if (width >= kWeakBelow) return ParameterVerdict::kNotIdentified;
  if (at_bound) return ParameterVerdict::kAtBound;
  const bool is_identified = width < kIdentifiedBelow && !IsLoose(spec, summary);
  return is_identified ? ParameterVerdict::kIdentified : ParameterVerdict::kWeak;
}

/// Whether the nominal parameters lie in the 99 % region of q, widened by a hundredth of each range, which nobody would
/// call a gap. Of a grid: whether each lies in its central 99 % interval.
bool ContainsNominal(const Designer& q) {
  if (q.grid() != nullptr) {
    const std::vector<Designer::Interval> intervals = q.CentralInterval(0.99);
    for (int i = 0; i < q.size(); ++i) {
      const Designer::Interval& interval = intervals[static_cast<size_t>(i)];
      if (q.space()[i].nominal < interval.low || q.space()[i].nominal > interval.high) return false;
    }
    return true;
  }
  const std::vector<double> nominal = ZToLogit(q.space(), q.space().Nominal());
  Eigen::MatrixXd covariance = q.Covariance();
  Eigen::VectorXd difference(q.size());
  for (int i = 0; i < q.size(); ++i) {
    difference[i] = nominal[static_cast<size_t>(i)] - q.mean()[static_cast<size_t>(i)];
    covariance(i, i) += kNoticeable * kNoticeable;
  }
  const double distance = difference.dot(covariance.ldlt().solve(difference));
  // The 99 % quantile of chi-squared, by Wilson and Hilferty (1931).
  const double n = q.size(), third = 2.0 / (9.0 * n);
  return distance <= n * std::pow(1.0 - third + 2.3263 * std::sqrt(third), 3);
}

/// What a simulator leaves more than the floor, over a horizon or in one of its channels.
constexpr auto kExcessOfDesign = [](const auto& of) { return of.excess; };
constexpr auto kExcessOfNominal = [](const auto& of) {
  return Estimated{of.excess.value + of.gain.value, std::hypot(of.excess.error, of.gain.error)};
};

/// Whether that is somewhere noticeable and beyond chance.
template <class ExcessOf>
bool ExceedsFloor(const HeldOutPrediction& prediction, const ExcessOf& excess_of) {
  return std::ranges::any_of(prediction.horizons, [&](const HeldOutPrediction::Horizon& h) {
    return IsExcess(excess_of(h)) ||
           std::ranges::any_of(h.channels, [&](const auto& channel) { return IsChannelExcess(excess_of(channel)); });
  });
}

/// Whether the design leaves something to find. Where guesses are far nearer than it is, so may its floor be uncertain.
bool IsOff(const HeldOutPrediction& prediction) {
  return ExceedsFloor(prediction, kExcessOfDesign) || GuessesAsWell(prediction.horizons, kFarFromGuess);
}

/// Whether the nominal simulator is grossly off, be it sure or not: few windows tell no standard error. A floor that is
/// high because the parameters are uncertain is none of that simulator.
bool NominalIsFarOff(const HeldOutPrediction& prediction) {
  return std::ranges::any_of(prediction.horizons, [](const HeldOutPrediction::Horizon& h) {
    return std::max(0.0, h.excess.value) + h.gain.value > kFarOff;
  });
}

/// Surely or not: few windows leave large gains unsure.
bool GainsNoticeably(const HeldOutPrediction& prediction) {
  return std::ranges::any_of(prediction.horizons,
                             [](const HeldOutPrediction::Horizon& h) { return h.gain.value > kLeastExcess; });
}

bool LiesOffNominal(const ParameterSpec& spec, const ParameterSummary& s) {
  return LiesOff(s.mode, spec.nominal, s.std, spec.high - spec.low);
}

DesignVerdict ByPredictionAlone(const Designer& q, const HeldOutPrediction& prediction,
                                const std::vector<int>& at_bounds) {
  const bool better = PredictsBetter(prediction);
  if (ReachesFloor(prediction)) {
    const bool as_well = !better && !GainsNoticeably(prediction);
    const bool is_nominal = ContainsNominal(q) && !NominalIsFarOff(prediction);
    return as_well || is_nominal ? DesignVerdict::kNoGap : DesignVerdict::kGapClosed;
  }
  const bool may_tell = !FollowsAFewWindows(prediction.horizons);
  if (!better && may_tell && NominalReachesFloor(prediction)) return DesignVerdict::kNoGap;
  if (GuessesAsWell(prediction.horizons)) return DesignVerdict::kOutsideFamily;
  if (!better && !ExceedsFloor(prediction, kExcessOfNominal)) return DesignVerdict::kUndecided;
  if (!better && !ExceedsFloor(prediction, kExcessOfDesign)) return DesignVerdict::kUndecided;
  return better && at_bounds.empty() ? DesignVerdict::kGapNarrowed : DesignVerdict::kOutsideFamily;
}

}  // namespace

const NamedValues<ParameterVerdict>& ParameterVerdictNames() {
  static const NamedValues<ParameterVerdict> names = {{ParameterVerdict::kIdentified, "identified"},
                                                      {ParameterVerdict::kWeak, "weak"},
                                                      {ParameterVerdict::kNotIdentified, "not_identified"},
                                                      {ParameterVerdict::kAtBound, "at_bound"}};
  return names;
}

const NamedValues<DesignVerdict>& DesignVerdictNames() {
  static const NamedValues<DesignVerdict> names = {{DesignVerdict::kNoGap, "no_gap"},
                                                   {DesignVerdict::kGapClosed, "gap_closed"},
                                                   {DesignVerdict::kGapNarrowed, "gap_narrowed"},
                                                   {DesignVerdict::kOutsideFamily, "outside_family"},
                                                   {DesignVerdict::kUndecided, "undecided"}};
  return names;
}

std::string ToString(ParameterVerdict verdict) { return NameOf(ParameterVerdictNames(), verdict); }
std::string ToString(DesignVerdict verdict) { return NameOf(DesignVerdictNames(), verdict); }

std::vector<ParameterSummary> SummarizeParameters(const std::vector<Designer>& designs, int best,
                                                  const std::vector<bool>& has_effect, bool reaches_floor,
                                                  const std::vector<HeldOutPrediction::OpenEnd>& open_ends,
                                                  const std::vector<std::vector<SearchInterval>>& otherwise) {
  OTED_CHECK(!designs.empty());
  const ParameterSpace& space = designs[0].space();
  const double n = static_cast<double>(designs.size());
  std::vector<ParameterSummary> summaries;
  for (int p = 0; p < space.size(); ++p) {
    const size_t i = static_cast<size_t>(p);
    ParameterSummary summary;
    double mean = 0, within = 0, between = 0;
    for (const Designer& q : designs) mean += q.Mode()[i] / n;
    for (const Designer& q : designs) {
      within += q.Std()[i] * q.Std()[i] / n;
      between += (q.Mode()[i] - mean) * (q.Mode()[i] - mean) / n;
    }
    summary.mode = designs[static_cast<size_t>(best)].Mode()[i];
    summary.std = std::sqrt(within + between);
    if (designs[0].grid() != nullptr) {
      summary.interval90_low = GridMixtureQuantile(designs, i, 0.05);
      summary.interval90_high = GridMixtureQuantile(designs, i, 0.95);
    } else {
      summary.interval90_low = ZOf(designs[0], i, MixtureQuantile(designs, i, 0.05));
      summary.interval90_high = ZOf(designs[0], i, MixtureQuantile(designs, i, 0.95));
    }
    const bool at_bound = EndsAtBound(space[p], summary.interval90_low, summary.interval90_high);
    const SearchInterval own{summary.interval90_low, summary.interval90_high};
    bool is_disputed = false;
    for (const std::vector<SearchInterval>& intervals : otherwise) {
      if (intervals[i].low > intervals[i].high) continue;  // it says nothing of this one
      is_disputed |= intervals[i].high < own.low || intervals[i].low > own.high;
      summary.interval90_low = std::min(summary.interval90_low, intervals[i].low);
      summary.interval90_high = std::max(summary.interval90_high, intervals[i].high);
    }
    // Logits never reach a bound: an end that is as near is there.
    if (UnitOf(space[p], summary.interval90_low) < kAtBound) summary.interval90_low = space[p].low;
    if (UnitOf(space[p], summary.interval90_high) > 1 - kAtBound) summary.interval90_high = space[p].high;
    for (const HeldOutPrediction::OpenEnd& end : open_ends) {
      if (end.parameter != p) continue;
      (end.above ? summary.interval90_high : summary.interval90_low) = end.above ? space[p].high : space[p].low;
    }
    summary.verdict = VerdictOf(space[p], summary, PriorWidth(designs[0], p), at_bound);
    if (!has_effect[i]) summary.verdict = ParameterVerdict::kNotIdentified;
    // A spread much narrower than the interval beside it would seem to contradict it.
    const double width = summary.interval90_high - summary.interval90_low;
    if (width > own.high - own.low) summary.std = std::max(summary.std, width / kWidthOfInterval);
    const bool is_open = !reaches_floor || is_disputed;
    if (is_open && summary.verdict == ParameterVerdict::kIdentified) summary.verdict = ParameterVerdict::kWeak;
    summaries.push_back(summary);
  }
  return summaries;
}

std::vector<int> NarrowParameters(const Designer& q) {
  std::vector<int> narrow;
  for (int i = 0; i < q.size(); ++i) {
    if (IsNarrower(q, i, kIdentifiedBelow)) narrow.push_back(i);
  }
  return narrow;
}

bool EndsAtBound(const ParameterSpec& spec, double low, double high) {
  const double nominal = UnitOf(spec, spec.nominal);
  const bool physical_zero = spec.low == 0 && !spec.field.starts_with("opt/gravity") && !spec.field.ends_with("/bias");
  const bool at_low = UnitOf(spec, low) < kAtBound && nominal > 2 * kAtBound && !physical_zero;
  const bool at_high = UnitOf(spec, high) > 1 - kAtBound && nominal < 1 - 2 * kAtBound;
  return at_low || at_high;
}

bool IsNoBetterThanGuess(double error, double guess) { return guess > 0 && !(error < kGuess * guess); }

bool IsFloorTold(const HeldOutPrediction& prediction) {
  if (FollowsAFewWindows(prediction.horizons)) return false;
  return std::ranges::all_of(prediction.horizons, [](const HeldOutPrediction::Horizon& h) {
    return !IsTold(h) || TellsFloor(MostTimesFloor(h));
  });
}

bool ReachesFloor(const HeldOutPrediction& prediction) {
  const bool in_all = std::ranges::none_of(prediction.horizons, &HeldOutPrediction::Horizon::surely_odd);
  return !IsOff(prediction) && IsFloorTold(prediction) && in_all && !ShowsNothing(prediction.horizons);
}

bool NominalReachesFloor(const HeldOutPrediction& prediction) {
  return std::ranges::all_of(prediction.horizons, [](const HeldOutPrediction::Horizon& h) {
    return kExcessOfNominal(h).value <= kLeastExcess && std::ranges::all_of(h.channels, [](const auto& c) {
             return kExcessOfNominal(c).value <= kLeastChannelExcess;
           });
  });
}

bool LeavesGap(const HeldOutPrediction& prediction) {
  return IsOff(prediction) && !NominalReachesFloor(prediction) && !ShowsNothing(prediction.horizons);
}

std::vector<int> ChannelsOff(const HeldOutPrediction& prediction) {
  if (!ExceedsFloor(prediction, kExcessOfDesign) || ShowsNothing(prediction.horizons)) return {};
  const size_t n = prediction.horizons.front().channels.size();
  std::vector<double> excess(n, 0.0), of_off(n, 0.0);
  for (const HeldOutPrediction::Horizon& h : prediction.horizons) {
    for (size_t c = 0; c < n; ++c) {
      const Estimated& e = h.channels[c].excess;
      excess[c] = std::max(excess[c], e.value);
      if (IsChannelExcess(e)) of_off[c] = std::max(of_off[c], e.value);
    }
  }
  std::vector<int> channels;
  for (size_t c = 0; c < n; ++c) {
    if (of_off[c] > 0) channels.push_back(static_cast<int>(c));
  }
  std::ranges::stable_sort(
      channels, [&](int a, int b) { return of_off[static_cast<size_t>(a)] > of_off[static_cast<size_t>(b)]; });
  if (channels.empty()) channels.push_back(static_cast<int>(std::ranges::max_element(excess) - excess.begin()));
  return channels;
}

bool IsSure(const Estimated& gain) { return gain.value > std::max(kLeastGain, kGainErrors * gain.error); }
bool IsSureLoss(const Estimated& gain) { return IsSure({-gain.value, gain.error}); }

bool IsSurelyBetter(const HeldOutPrediction::Horizon& compared) {
  return IsSure(compared.gain) || (compared.gain.value > kLeastGain && IsSure(compared.typical_gain));
}

bool IsSurelyWorse(const HeldOutPrediction::Horizon& compared) {
  return IsSure(compared.gain) || std::ranges::any_of(compared.channels, [](const HeldOutPrediction::Channel& c) {
           return IsChannelExcess(c.gain);
         });
}

bool PredictsBetter(const HeldOutPrediction& prediction) {
  const bool all_learned = std::ranges::all_of(prediction.horizons, &HeldOutPrediction::Horizon::learned);
  const bool better = std::ranges::any_of(prediction.horizons, [&](const HeldOutPrediction::Horizon& h) {
    // Other recordings say more than a few windows that are far off in parts of those that it learned from.
    const bool is_sure = IsSurelyBetter(h) || (h.gain.value > kLeastGain && IsSure(h.gain_of_recordings));
    return (all_learned || !h.learned) && is_sure;
  });
  return better && !PredictsWorse(prediction);
}

bool PredictsWorse(const HeldOutPrediction& prediction) {
  return std::ranges::any_of(prediction.horizons, [](const HeldOutPrediction::Horizon& h) {
    return IsSureLoss(h.gain) || IsSureLoss(h.gain_of_recordings);
  });
}

DesignVerdict JudgePrediction(const Designer& q, const HeldOutPrediction& prediction, const FitDoubts& doubts) {
  if (ShowsNothing(prediction.horizons)) return DesignVerdict::kUndecided;
  const bool better = PredictsBetter(prediction);
  const DesignVerdict verdict = ByPredictionAlone(q, prediction, doubts.at_bounds);
  if (verdict == DesignVerdict::kGapClosed && doubts.fails_in_a_recording) return DesignVerdict::kGapNarrowed;
  const bool may_be_fine = FloorIsReached(verdict) || verdict == DesignVerdict::kUndecided;
  if (!may_be_fine || !doubts.asks_for_more) return verdict;
  return better ? DesignVerdict::kGapNarrowed : DesignVerdict::kOutsideFamily;
}

bool CannotTell(double common) { return std::numbers::ln2 - common < kNoGapMargin; }

DesignVerdict JudgeDesign(double nominal_common, double designed_common, int n_transitions) {
  if (n_transitions < kFewestJudged) return DesignVerdict::kUndecided;
  const double nominal_gap = std::numbers::ln2 - nominal_common, designed_gap = std::numbers::ln2 - designed_common;
  if (CannotTell(nominal_common) && nominal_gap - designed_gap < kNoGainMargin) return DesignVerdict::kNoGap;
  if (CannotTell(designed_common)) return DesignVerdict::kGapClosed;
  if (designed_gap < (1 - kNarrowedShare) * nominal_gap) return DesignVerdict::kGapNarrowed;
  return DesignVerdict::kOutsideFamily;
}

double SmallChange(const ParameterSpec& spec, double z) {
  const double share = kSmallShare * std::abs(z), range = spec.high - spec.low;
  if (spec.IsMultiple() || spec.logarithmic) return share;
  const double of_range = kSmallOfRange * range;
  return HasOwnSize(spec) ? of_range : std::clamp(share, kNextToNothingOfRange * range, of_range);
}

std::vector<int> ParametersAtBounds(const Designer& q) {
  const std::vector<double> mode = q.Mode();
  std::vector<int> at_bounds;
  for (int i = 0; i < q.size(); ++i) {
    const double z = mode[static_cast<size_t>(i)];
    if (EndsAtBound(q.space()[i], z, z) && IsNarrower(q, i, kWeakBelow)) at_bounds.push_back(i);
  }
  return at_bounds;
}

bool LiesOff(double mode, double nominal, double std, double range) {
  return std::abs(mode - nominal) > std::max(3 * std, kMovedAbove * range);
}

void WeakenDoubted(const ParameterSpace& space, bool can_tell, const std::vector<int>& unsettled,
                   std::vector<ParameterSummary>& summaries) {
  for (int i = 0; i < space.size(); ++i) {
    ParameterSummary& s = summaries[static_cast<size_t>(i)];
    const bool is_doubted = std::ranges::count(unsettled, i) > 0 || (!can_tell && LiesOffNominal(space[i], s));
    if (is_doubted && s.verdict == ParameterVerdict::kIdentified) s.verdict = ParameterVerdict::kWeak;
  }
}

bool HasMoved(const ParameterSpace& space, const std::vector<ParameterSummary>& summaries) {
  for (int i = 0; i < space.size(); ++i) {
    const ParameterSummary& s = summaries[static_cast<size_t>(i)];
    if (s.verdict == ParameterVerdict::kIdentified && LiesOffNominal(space[i], s)) return true;
  }
  return false;
}

}  // namespace oted
