#pragma once
/// What parameters mean and do, before any design: the numbers behind each, its measured effect on episodes, and which
/// of them trade off.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/effects.h"

namespace oted {

struct CheckedParameter {
  ParameterSpec spec;  ///< completed: unit, nominal
  PathInfo info;       ///< everything that it sets
  ParameterEffect effect;
  bool has_effect() const { return effect.largest_change > 0; }
  /// The observation that reacts most; -1 without effect on any.
  int most_affected() const;
};

/// Two parameters whose effects on observations are nearly collinear.
struct TradeOff {
  int first, second;
  double cosine;
};

struct ParameterCheck {
  SimulatorSpec simulator;
  std::vector<CheckedParameter> parameters;
  std::vector<TradeOff> trade_offs;  ///< strongest first
  Array2<double> cosines;            ///< of all pairs: EffectCosines
  int n_episodes = 0, n_transitions = 0;
  bool logged = false;  ///< measured on logged episodes; otherwise on episodes of random actions

  bool all_have_effect() const;
  /// Schema oted.params_check/1.
  nlohmann::json ToJson() const;
};

inline constexpr double kTradeOffCosine = 0.95;  ///< |cosine| from which on two parameters are said to trade off

/// @param logs  logged episodes, of which the first three are replayed; null: episodes with random actions are made in
/// the nominal simulator.
ParameterCheck CheckParameters(const SimulatorFactory& factory, const Dataset* logs, RngKey key, int n_threads);

}  // namespace oted
