#include "oted/checks/parameter_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/sim/rollout.h"

namespace oted {
namespace {

using nlohmann::json;

constexpr int kLoggedEpisodes = 3;  // as before a design
constexpr int kRandomEpisodes = 10;
constexpr int kRandomSteps = 300;  // per episode at most
constexpr int kStarts = 100;

/// Episodes with uniformly random actions in the nominal simulator.
Dataset RandomEpisodes(const SimulatorFactory& factory, RngKey key, int n_threads) {
  const auto simulator = factory.Make(1, n_threads);
  const SimulatorSpec& spec = factory.spec();
  if (spec.n_discrete_actions > 0) {
    throw DataError("random episodes are made of continuous actions; name logged ones with --data");
  }
  simulator->SetParameters(0, factory.parameters().Nominal());
  Dataset dataset;
  for (int episode = 0; episode < kRandomEpisodes; ++episode) {
    Rng rng = key.Index(static_cast<uint64_t>(episode)).MakeRng();
    simulator->Reset(0, rng);
    const BatchPolicy act = UniformRandomPolicy(spec, rng);
    std::vector<double> action(static_cast<size_t>(spec.act_dim));
    for (int step = 0; step < kRandomSteps; ++step) {
      const std::vector<double> before(simulator->observation(0).begin(), simulator->observation(0).end());
      act(before, 1, action);
      const int lane = 0;
      simulator->Step({&lane, 1}, action);
      if (simulator->status(0) == LaneStatus::kDiverged) break;
      dataset.observations.AppendRow(before);
      dataset.actions.AppendRow(action);
      dataset.next_observations.AppendRow(simulator->observation(0));
      dataset.terminals.push_back(simulator->status(0) == LaneStatus::kTerminated);
      dataset.timeouts.push_back(0);
      if (simulator->status(0) != LaneStatus::kRunning) break;
    }
    if (dataset.size() > 0 && dataset.terminals.back() == 0) dataset.timeouts.back() = 1;
  }
  if (dataset.size() == 0) {
    throw DataError(
        fmt::format("the nominal simulator of task '{}' diverges in its first step under random actions", spec.task));
  }
  return dataset;
}

}  // namespace

int CheckedParameter::most_affected() const {
  const auto& changes = effect.by_observation;
  const auto largest = std::max_element(changes.begin(), changes.end());
  return largest == changes.end() || *largest == 0 ? -1 : static_cast<int>(largest - changes.begin());
}

bool ParameterCheck::all_have_effect() const {
  return std::all_of(parameters.begin(), parameters.end(), [](const CheckedParameter& p) { return p.has_effect(); });
}

ParameterCheck CheckParameters(const SimulatorFactory& factory, const Dataset* logs, RngKey key, int n_threads) {
  const SimulatorSpec& spec = factory.spec();
  if (logs != nullptr) logs->CheckFits(spec.task, spec.obs_dim(), spec.act_dim);
  Dataset episodes;
  if (logs == nullptr) {
    episodes = RandomEpisodes(factory, key.Stage("random episodes"), n_threads);
  } else {
    std::vector<Episode> first = logs->Episodes();
    first.resize(std::min(first.size(), static_cast<size_t>(kLoggedEpisodes)));
    episodes = logs->Select(first);
  }
  ParameterCheck check;
  check.simulator = spec;
  check.logged = logs != nullptr;
  check.n_episodes = static_cast<int>(episodes.Episodes().size());
  check.n_transitions = episodes.size();
  const auto effects = MeasureEffects(factory, episodes, check.n_episodes, key.Stage("effects"), n_threads);
  check.cosines = EffectCosines(factory, episodes, kStarts, key.Stage("cosines"), n_threads);
  for (int i = 0; i < factory.parameters().size(); ++i) {
    const ParameterSpec& parameter = factory.parameters()[i];
    check.parameters.push_back({parameter, factory.Describe(parameter.field), effects[static_cast<size_t>(i)]});
    for (int k = 0; k < i; ++k) {
      if (std::abs(check.cosines(k, i)) >= kTradeOffCosine) check.trade_offs.push_back({k, i, check.cosines(k, i)});
    }
  }
  std::stable_sort(check.trade_offs.begin(), check.trade_offs.end(),
                   [](const TradeOff& a, const TradeOff& b) { return std::abs(a.cosine) > std::abs(b.cosine); });
  return check;
}

json ParameterCheck::ToJson() const {
  json document = {{"schema", "oted.params_check/1"},
                   {"task", simulator.task},
                   {"measured_on",
                    {{"episodes", logged ? "logged" : "random_actions"},
                     {"n_episodes", n_episodes},
                     {"n_transitions", n_transitions}}},
                   {"observations", simulator.observation_names},
                   {"parameters", json::array()},
                   {"trade_offs", json::array()}};
  for (const CheckedParameter& p : parameters) {
    json places = json::array();
    for (const ParameterPlace& place : p.info.places) {
      places.push_back({{"path", place.path}, {"nominal", place.nominal}});
    }
    document["parameters"].push_back({{"name", p.spec.name},
                                      {"field", p.spec.field},
                                      {"meaning", p.info.meaning},
                                      {"value_unit", p.info.unit},
                                      {"unit", p.spec.unit},
                                      {"scale", p.spec.scale == ParameterScale::kAbsolute ? "absolute" : "nominal"},
                                      {"log", p.spec.logarithmic},
                                      {"nominal", p.spec.nominal},
                                      {"bounds", {p.spec.low, p.spec.high}},
                                      {"sets", places},
                                      {"has_effect", p.has_effect()},
                                      {"largest_change", p.effect.largest_change},
                                      {"change_by_observation", p.effect.by_observation}});
  }
  for (const TradeOff& pair : trade_offs) {
    document["trade_offs"].push_back({{"parameters",
                                       {parameters[static_cast<size_t>(pair.first)].spec.name,
                                        parameters[static_cast<size_t>(pair.second)].spec.name}},
                                      {"cosine", pair.cosine}});
  }
  return document;
}

}  // namespace oted
