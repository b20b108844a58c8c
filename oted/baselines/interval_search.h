#pragma once
/// IS: interval search (the paper's Sec. 5.1, "inspired by ADR"): simulator parameters are drawn from intervals that
/// begin at a point and grow where the agent does well. The rule is that of automatic domain randomisation (Akkaya et
/// al. 2019, Algorithm 1). The paper gives no more than the sentence above: docs/deviations.md#interval-search.

#include <map>
#include <string>
#include <vector>

#include "oted/rl/training.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// Defaults: docs/deviations.md#interval-search.
struct IntervalSearchConfig {
  double boundary = 0.5;  ///< share of the episodes with one parameter at one of its bounds
  int episodes = 5;       ///< at a bound, for one decision on it
  double step = 0.1;      ///< of a bound, in ranges (of a logarithmic parameter: in log z)
  double grow = 0.2;      ///< mean performance from which a bound moves outwards ...
  double shrink = 0.1;    ///< ... and down to which inwards
  double reference = 0;   ///< return that counts as performance 1; 0: the task's own (D4RL's expert)
};

/// Returns as performances: 0 for random actions, 1 for the reference.
struct ReturnScale {
  double random = 0, reference = 1;
  double Performance(double episode_return) const { return (episode_return - random) / (reference - random); }
};

/// The task's own scale where config.reference is 0; otherwise the mean return of 16 episodes of random actions at
/// `start` counts as 0. @throws UsageError where neither gives a reference above random actions
ReturnScale ScaleOf(const SimulatorFactory& factory, const IntervalSearchConfig& config,
                    const std::vector<double>& start, RngKey key);

/// @throws UsageError where the task has no reference of its own and the settings name none, or they contradict
void CheckIntervalSearch(const IntervalSearchConfig& config, const SimulatorSpec& spec);

/// Intervals [low_i, high_i] of every parameter, both ends at `start` first. With probability `boundary` an episode has
/// one parameter, drawn uniformly, at its low or its high end, drawn uniformly; all others are uniform in their
/// intervals. The performances of the training episodes at an end are collected, and after `episodes` of them the end
/// moves: outwards where their mean is at least `grow`, inwards where it is at most `shrink`. It never leaves the
/// parameter's range and never crosses `start`. A diverged episode counts as 0 at most; one whose end has moved
/// meanwhile is forgotten.
class IntervalSearch : public EpisodeSource {
 public:
  /// @param start  z; where it lies outside of a range, that range's nearest end is taken
  IntervalSearch(ParameterSpace space, const std::vector<double>& start, const IntervalSearchConfig& config,
                 ReturnScale scale);

  std::unique_ptr<EpisodeSource> Clone() const override { return std::make_unique<IntervalSearch>(*this); }
  std::vector<double> Draw(int lane, Rng& rng) override;
  void EpisodeEnded(int lane, double episode_return, bool diverged) override;
  /// "interval/low/NAME", "interval/high/NAME": the ends, in z.
  std::vector<std::pair<std::string, double>> Figures() const override;
  void Save(NpzArrays& arrays) const override;
  void Restore(const NpzArrays& arrays) override;

  /// The ends as z.
  std::vector<double> Low() const { return space_.FromUnit(ends_[0]); }
  std::vector<double> High() const { return space_.FromUnit(ends_[1]); }

 private:
  /// An end: side 0 is low, 1 is high. `value` is where it was.
  struct End {
    size_t parameter = 0, side = 0;
    double value = 0;
  };
  void Decide(const End& end);
  std::vector<double>& PerformancesAt(const End& end) { return performances_[2 * end.parameter + end.side]; }

  ParameterSpace space_;
  IntervalSearchConfig config_;
  ReturnScale scale_;
  std::vector<double> start_;                      // in the unit cube, as everything below
  std::vector<double> ends_[2];                    // by side, then parameter
  std::vector<std::vector<double>> performances_;  // at each end, since it last moved or was decided on
  std::map<int, End> at_end_;                      // lanes whose episode lies at an end
};

}  // namespace oted
