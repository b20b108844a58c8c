#include "oted/stages/design/effects.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "oted/data/normalizer.h"

namespace oted {
namespace {

constexpr double kBroke = 1e9;

/// Lane 2i holds parameter i at its lower bound, lane 2i + 1 at its upper one.
class BoundLanes {
 public:
  BoundLanes(const SimulatorFactory& factory, const Dataset& dataset, int n_threads)
      : simulator_(factory.Make(2 * factory.parameters().size(), n_threads)),
        dataset_(dataset),
        normalizer_(Normalizer::Fit(dataset.observations)),
        effects_(static_cast<size_t>(factory.parameters().size())) {
    for (int lane = 0; lane < simulator_->n_lanes(); ++lane) {
      std::vector<double> z = factory.parameters().Nominal();
      const ParameterSpec& spec = factory.parameters()[lane / 2];
      z[static_cast<size_t>(lane / 2)] = lane % 2 == 0 ? spec.low : spec.high;
      simulator_->SetParameters(lane, z);
    }
  }

  Simulator& simulator() { return *simulator_; }
  const std::vector<ParameterEffect>& effects() const { return effects_; }

  /// Compares the two lanes of each parameter.
  void Compare() {
    for (size_t i = 0; i < effects_.size(); ++i) {
      const int low = static_cast<int>(2 * i), high = low + 1;
      const bool low_broke = simulator_->status(low) == LaneStatus::kDiverged;
      const bool high_broke = simulator_->status(high) == LaneStatus::kDiverged;
      // The numbers of a lane that diverged mean nothing; that one of two did is an effect.
      if (low_broke != high_broke) effects_[i].largest_change = std::max(effects_[i].largest_change, kBroke);
      if (low_broke || high_broke) continue;
      const auto a = simulator_->observation(low), b = simulator_->observation(high);
      for (size_t j = 0; j < a.size(); ++j) {
        const double change = std::abs(a[j] - b[j]) / normalizer_.scale[j];
        effects_[i].largest_change = std::max(effects_[i].largest_change, change);
      }
      if (simulator_->status(low) != simulator_->status(high)) {
        effects_[i].largest_change = std::max(effects_[i].largest_change, 1.0);
      }
    }
  }

  /// The logged actions of one episode; lanes that ended go on, as the log did.
  void Replay(const Episode& episode) {
    std::vector<int> lanes(static_cast<size_t>(simulator_->n_lanes()));
    std::iota(lanes.begin(), lanes.end(), 0);
    std::vector<double> actions;
    Compare();
    for (int i = episode.begin; i < episode.end; ++i) {
      actions.clear();
      for (size_t lane = 0; lane < lanes.size(); ++lane) {
        const auto action = dataset_.actions.row(i);
        actions.insert(actions.end(), action.begin(), action.end());
      }
      simulator_->Step(lanes, actions);
      Compare();
    }
  }

 private:
  std::unique_ptr<Simulator> simulator_;
  const Dataset& dataset_;
  Normalizer normalizer_;
  std::vector<ParameterEffect> effects_;
};

}  // namespace

std::vector<ParameterEffect> MeasureEffects(const SimulatorFactory& factory, const Dataset& dataset, int max_episodes,
                                            RngKey key, int n_threads) {
  BoundLanes lanes(factory, dataset, n_threads);
  std::vector<Episode> episodes = dataset.Episodes();
  episodes.resize(std::min(episodes.size(), static_cast<size_t>(max_episodes)));
  for (size_t e = 0; e < episodes.size(); ++e) {
    for (int lane = 0; lane < lanes.simulator().n_lanes(); ++lane) {
      Rng rng = key.Index(e).MakeRng();
      lanes.simulator().Reset(lane, rng);
    }
    lanes.Replay(episodes[e]);
    if (!factory.spec().can_set_state) continue;
    bool settable = true;
    for (int lane = 0; lane < lanes.simulator().n_lanes(); ++lane) {
      settable =
          settable && lanes.simulator().SetStateFromObservation(lane, dataset.observations.row(episodes[e].begin));
    }
    if (settable) lanes.Replay(episodes[e]);
  }
  return lanes.effects();
}

}  // namespace oted
