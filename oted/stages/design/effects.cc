#include "oted/stages/design/effects.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "oted/data/normalizer.h"
#include "oted/sim/log_window.h"

namespace oted {
namespace {

constexpr double kWholeRange = 1.0;
constexpr double kSmallStep = 0.02;

/// Lane 2i holds parameter i `step` of its range below nominal, lane 2i + 1 as much above, at most at its bounds. The
/// last lane is nominal.
class PairedLanes {
 public:
  PairedLanes(const SimulatorFactory& factory, const Dataset& dataset, double step, int n_threads)
      : simulator_(factory.Make(2 * factory.parameters().size() + 1, n_threads)),
        dataset_(dataset),
        normalizer_(Normalizer::Fit(dataset.observations)),
        effects_(static_cast<size_t>(factory.parameters().size())),
        changes_(factory.parameters().size(), dataset.obs_dim()),
        products_(factory.parameters().size(), factory.parameters().size()) {
    const std::vector<double> nominal = factory.parameters().Nominal(), u = factory.parameters().ToUnit(nominal);
    const int nominal_lane = simulator_->n_lanes() - 1;
    simulator_->SetParameters(nominal_lane, nominal);
    for (int lane = 0; lane < nominal_lane; ++lane) {
      const size_t i = static_cast<size_t>(lane / 2);
      std::vector<double> moved = u, z = nominal;
      moved[i] = std::clamp(u[i] + (lane % 2 == 0 ? -step : step), 0.0, 1.0);
      z[i] = factory.parameters().FromUnit(moved)[i];
      simulator_->SetParameters(lane, z);
    }
    for (ParameterEffect& effect : effects_) effect.by_observation.assign(normalizer_.scale.size(), 0.0);
  }

  const std::vector<ParameterEffect>& effects() const { return effects_; }
  /// Of the changes of each two parameters, summed over observations and steps.
  const Array2<double>& products() const { return products_; }

  /// Compares the two lanes of each parameter, and each with the nominal one: what acts alike on both sides of the
  /// nominal value differs from that alone.
  void Compare() {
    const int nominal = simulator_->n_lanes() - 1;
    const bool has_nominal = simulator_->status(nominal) != LaneStatus::kDiverged;
    const auto c = simulator_->observation(nominal);
    for (size_t i = 0; i < effects_.size(); ++i) {
      const int low = static_cast<int>(2 * i), high = low + 1;
      const bool low_broke = simulator_->status(low) == LaneStatus::kDiverged;
      const bool high_broke = simulator_->status(high) == LaneStatus::kDiverged;
      // The numbers of a lane that diverged mean nothing; that one of two did is an effect.
      if (low_broke != high_broke) effects_[i].largest_change = std::max(effects_[i].largest_change, kBreaksDown);
      std::fill(changes_.row(low / 2).begin(), changes_.row(low / 2).end(), 0.0);
      if (low_broke || high_broke) continue;
      const auto a = simulator_->observation(low), b = simulator_->observation(high);
      for (size_t j = 0; j < a.size(); ++j) {
        changes_(low / 2, static_cast<int>(j)) = (b[j] - a[j]) / normalizer_.scale[j];
        const double apart =
            std::max({a[j], b[j], has_nominal ? c[j] : a[j]}) - std::min({a[j], b[j], has_nominal ? c[j] : a[j]});
        const double change = apart / normalizer_.scale[j];
        effects_[i].largest_change = std::max(effects_[i].largest_change, change);
        effects_[i].by_observation[j] = std::max(effects_[i].by_observation[j], change);
      }
      if (simulator_->status(low) != simulator_->status(high)) {
        effects_[i].largest_change = std::max(effects_[i].largest_change, 1.0);
      }
    }
    for (int i = 0; i < products_.rows(); ++i) {
      for (int k = 0; k < products_.cols(); ++k) {
        const auto a = changes_.row(i), b = changes_.row(k);
        products_(i, k) += std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
      }
    }
  }

  void ResetAll(RngKey key) {
    for (int lane = 0; lane < simulator_->n_lanes(); ++lane) {
      Rng rng = key.MakeRng();
      simulator_->Reset(lane, rng);
    }
  }

  /// Puts every lane into the state of one row. False when that cannot be.
  bool SetAll(const Episode& episode, int row) {
    const LoggedHistory before = HistoryBefore(dataset_, {.begin = row, .n_steps = 1, .episode_begin = episode.begin});
    bool settable = true;
    for (int lane = 0; lane < simulator_->n_lanes(); ++lane) {
      settable = settable && simulator_->SetStateFromLog(lane, dataset_.observations.row(row), before);
    }
    return settable;
  }

  bool AllHaveOne() const {
    return std::ranges::all_of(effects_, [](const ParameterEffect& effect) { return effect.largest_change > 0; });
  }

  /// The logged actions of one episode, or of a part of it; lanes that ended go on, as the log did.
  /// @param until_all  no further than each parameter has shown an effect
  void Replay(const Episode& episode, bool until_all = false) {
    std::vector<int> lanes(static_cast<size_t>(simulator_->n_lanes()));
    std::iota(lanes.begin(), lanes.end(), 0);
    std::vector<double> actions;
    Compare();
    for (int i = episode.begin; i < episode.end && !(until_all && AllHaveOne()); ++i) {
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
  Array2<double> changes_;   // (d, obs_dim), at the last comparison
  Array2<double> products_;  // (d, d)
};

std::vector<ParameterEffect> Measured(const SimulatorFactory& factory, const Dataset& dataset, int max_episodes,
                                      RngKey key, int n_threads, bool until_all) {
  PairedLanes lanes(factory, dataset, kWholeRange, n_threads);
  std::vector<Episode> episodes = dataset.Episodes();
  episodes.resize(std::min(episodes.size(), static_cast<size_t>(max_episodes)));
  for (size_t e = 0; e < episodes.size() && !(until_all && lanes.AllHaveOne()); ++e) {
    lanes.ResetAll(key.Index(e));
    lanes.Replay(episodes[e], until_all);
    if (factory.spec().can_set_state && lanes.SetAll(episodes[e], episodes[e].begin)) {
      lanes.Replay(episodes[e], until_all);
    }
  }
  return lanes.effects();
}

}  // namespace

std::vector<ParameterEffect> MeasureEffects(const SimulatorFactory& factory, const Dataset& dataset, int max_episodes,
                                            RngKey key, int n_threads) {
  return Measured(factory, dataset, max_episodes, key, n_threads, false);
}

std::vector<bool> HaveEffects(const SimulatorFactory& factory, const Dataset& dataset, int max_episodes, RngKey key,
                              int n_threads) {
  std::vector<bool> have;
  for (const ParameterEffect& effect : Measured(factory, dataset, max_episodes, key, n_threads, true)) {
    have.push_back(effect.largest_change > 0);
  }
  return have;
}

Array2<double> EffectCosines(const SimulatorFactory& factory, const Dataset& dataset, int n_starts, RngKey key,
                             int n_threads) {
  PairedLanes lanes(factory, dataset, kSmallStep, n_threads);
  // Spread evenly over the rows that have enough of their episode before them.
  std::vector<std::pair<Episode, int>> starts;
  for (const Episode& episode : dataset.Episodes()) {
    for (int row = episode.begin; row == episode.begin || row + kTradeOffSteps <= episode.end; ++row) {
      starts.push_back({episode, row});
    }
  }
  const size_t n = std::min(starts.size(), static_cast<size_t>(n_starts));
  for (size_t s = 0; s < n; ++s) {
    const auto& [episode, row] = starts[s * starts.size() / n];
    if (factory.spec().can_set_state) {
      if (!lanes.SetAll(episode, row)) continue;
      lanes.Replay({row, std::min(row + kTradeOffSteps, episode.end), false});
    } else {
      lanes.ResetAll(key.Index(s));
      lanes.Replay({episode.begin, std::min(episode.begin + kTradeOffSteps, episode.end), false});
    }
  }
  return CosinesOf(lanes.products());
}

Array2<double> CosinesOf(const Array2<double>& products) {
  Array2<double> cosines(products.rows(), products.cols(), 0.0);
  for (int i = 0; i < cosines.rows(); ++i) {
    for (int k = 0; k < cosines.cols(); ++k) {
      const double length = std::sqrt(products(i, i) * products(k, k));
      cosines(i, k) = i == k ? 1.0 : length > 0 ? products(i, k) / length : 0.0;
    }
  }
  return cosines;
}

}  // namespace oted
