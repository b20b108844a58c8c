#include "oted/run/training_ground.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "oted/base/error.h"
#include "oted/baselines/domain_randomization.h"
#include "oted/baselines/interval_search.h"
#include "oted/run/run_directory.h"
#include "oted/stages/agent/agent.h"

namespace oted {

using nlohmann::json;

namespace {

TrainingGround Drawn(EpisodeParameters draw, std::vector<std::vector<double>> evaluate_in) {
  return {std::make_unique<DrawnEpisodes>(std::move(draw)), std::move(evaluate_in)};
}

/// Over the whole range, and the same for every agent of a run, so that their returns compare.
std::vector<std::vector<double>> EvaluationDraws(const RunConfig& config, const SimulatorFactory& factory) {
  const int n = WithAgentSettings(config, factory.spec(), [](const auto& agent) { return agent.eval_episodes; });
  return UniformDraws(factory.parameters(), n,
                      RngKey(static_cast<uint64_t>(config.run.seed)).Stage("baselines").Stage("evaluation"));
}

}  // namespace

TrainingGround DesignedGround(const AgentsConfig& config, const DesignedSimulators& designed) {
  if (config.train_in == "best") return Drawn(DrawModes({designed.best}), {designed.best});
  return Drawn(config.train_in == "samples" ? DrawSamples(designed.q) : DrawModes(designed.modes), designed.modes);
}

std::vector<double> UndesignedParameters(const AgentsConfig& config, const ParameterSpace& space) {
  return config.undesigned_at.empty() ? space.Nominal() : config.undesigned_at;
}

TrainingGround ComparedGround(const std::string& name, const RunConfig& config, const SimulatorFactory& factory) {
  const ParameterSpace& space = factory.parameters();
  if (name == "dr") return Drawn(DrawUniformly(space), EvaluationDraws(config, factory));
  const std::vector<double> z = UndesignedParameters(config.agents, space);
  if (name == "is") {
    const IntervalSearchConfig& settings = config.baselines.is;
    const std::vector<double> start = space.FromUnit(space.ToUnit(z));
    const RngKey key = RngKey(static_cast<uint64_t>(config.run.seed)).Stage("baselines").Stage("random actions");
    return {std::make_unique<IntervalSearch>(space, start, settings, ScaleOf(factory, settings, start, key)),
            EvaluationDraws(config, factory)};
  }
  OTED_CHECK(name == "undesigned");
  return Drawn(DrawModes({z}), {z});
}

json ComparedIdentity(const std::string& name, const RunConfig& config, const ParameterSpace& space) {
  json identity = json::array();
  if (name != "undesigned") identity = {name, ParameterIdentity(space)};
  if (name == "is") {
    const IntervalSearchConfig& is = config.baselines.is;
    identity.push_back({is.boundary, is.episodes, is.step, is.grow, is.shrink, is.reference});
  }
  if (name != "dr" && !config.agents.undesigned_at.empty()) identity.push_back(config.agents.undesigned_at);
  return identity;
}

RngKey BcDrKey(const RunConfig& config) {
  return RngKey(static_cast<uint64_t>(config.run.seed)).Stage("baselines").Stage("bc_dr");
}

LearningCurve TrainAgentIn(const TrainingGround& ground, const SimulatorFactory& factory, const RunConfig& config,
                           int index, const std::filesystem::path& folder, const std::string& run_name,
                           const RunContext& context) {
  const RngKey key = RngKey(static_cast<uint64_t>(config.run.seed)).Stage("agent").Index(static_cast<uint64_t>(index));
  const auto train = [&](auto algorithm) -> LearningCurve {
    if constexpr (requires { algorithm.device; }) algorithm.device = config.agents.device;
    auto agent = TrainAgent({.factory = factory,
                             .source = *ground.episodes,
                             .eval_parameters = ground.evaluate_in,
                             .key = key,
                             .folder = folder,
                             .run_name = run_name,
                             .context = context},
                            algorithm);
    agent.policy.Save(folder / "policy.npz");
    return agent;
  };
  return WithAgentSettings(config, factory.spec(), train);
}

}  // namespace oted
