#include "oted/run/training_ground.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "oted/base/error.h"
#include "oted/baselines/domain_randomization.h"
#include "oted/baselines/interval_search.h"
#include "oted/run/fingerprint.h"
#include "oted/stages/agent/agent.h"

namespace oted {

using nlohmann::json;

namespace {

TrainingGround Drawn(EpisodeParameters draw, std::vector<std::vector<double>> evaluate_in) {
  return {std::make_unique<DrawnEpisodes>(std::move(draw)), std::move(evaluate_in)};
}

RngKey BaselinesKey(const RunConfig& config) {
  return RngKey(static_cast<uint64_t>(config.run.seed)).Stage("baselines");
}

/// Over the whole range, and the same for every agent of a run, so that their returns compare.
std::vector<std::vector<double>> EvaluationDraws(const RunConfig& config, const SimulatorFactory& factory) {
  const int n = config.Algorithm(factory.spec()).eval_episodes(config.algorithms);
  return UniformDraws(factory.parameters(), n, BaselinesKey(config).Stage("evaluation"));
}

TrainingGround IntervalGround(const RunConfig& config, const SimulatorFactory& factory) {
  const IntervalSearchConfig& settings = config.baselines.is;
  const ParameterSpace& space = factory.parameters();
  const std::vector<double> start = space.FromUnit(space.ToUnit(NominalParameters(config.agents, space)));
  const ReturnScale scale = ScaleOf(factory, settings, start, BaselinesKey(config).Stage("random actions"));
  return {std::make_unique<IntervalSearch>(space, start, settings, scale), EvaluationDraws(config, factory)};
}

}  // namespace

const NamedValues<Ground>& GroundNames() {
  static const NamedValues<Ground> names = {{Ground::kDesigned, "designed"},
                                            {Ground::kNominal, "nominal"},
                                            {Ground::kDomainRandomization, "dr"},
                                            {Ground::kIntervalSearch, "is"}};
  return names;
}

TrainingGround DesignedGround(TrainIn train_in, const DesignedSimulators& designed) {
  if (train_in == TrainIn::kBest) return Drawn(DrawModes({designed.best}), {designed.best});
  return Drawn(train_in == TrainIn::kSamples ? DrawSamples(designed.q) : DrawModes(designed.modes), designed.modes);
}

std::vector<double> NominalParameters(const AgentsConfig& config, const ParameterSpace& space) {
  return config.nominal_at.empty() ? space.Nominal() : config.nominal_at;
}

TrainingGround ComparedGround(Ground ground, const RunConfig& config, const SimulatorFactory& factory) {
  const ParameterSpace& space = factory.parameters();
  switch (ground) {
    case Ground::kDomainRandomization:
      return Drawn(DrawUniformly(space), EvaluationDraws(config, factory));
    case Ground::kIntervalSearch:
      return IntervalGround(config, factory);
    case Ground::kNominal: {
      const std::vector<double> z = NominalParameters(config.agents, space);
      return Drawn(DrawModes({z}), {z});
    }
    case Ground::kDesigned:
      break;
  }
  throw InternalError("designed simulators are no ground to compare with");
}

json ComparedIdentity(Ground ground, const RunConfig& config, const ParameterSpace& space) {
  json identity = json::array();
  if (ground != Ground::kNominal) identity = {NameOf(GroundNames(), ground), ParameterIdentity(space)};
  if (ground == Ground::kIntervalSearch) {
    const IntervalSearchConfig& is = config.baselines.is;
    identity.push_back({is.boundary, is.episodes, is.step, is.grow, is.shrink, is.reference});
  }
  if (ground != Ground::kDomainRandomization && !config.agents.nominal_at.empty()) {
    identity.push_back(config.agents.nominal_at);
  }
  return identity;
}

RngKey BaselineKey(const RunConfig& config, const std::string& name) { return BaselinesKey(config).Stage(name); }

}  // namespace oted
