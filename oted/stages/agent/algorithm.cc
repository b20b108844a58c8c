#include "oted/stages/agent/algorithm.h"

#include <algorithm>
#include <utility>

namespace oted {
namespace {

template <class Result>
TrainedAgent Trained(Result result) {
  TrainedAgent agent;
  agent.policy = std::make_unique<decltype(result.policy)>(std::move(result.policy));
  agent.curve = std::move(result);
  return agent;
}

AlgorithmEntry Sac() {
  return {.algorithm = AgentAlgorithm::kSac,
          .name = "sac",
          .title = "SAC",
          .discrete_actions = false,
          .fields = [](AlgorithmSettings& settings) { return settings.sac.Fields(); },
          .n_steps = [](const AlgorithmSettings& settings) { return settings.sac.n_steps; },
          .eval_episodes = [](const AlgorithmSettings& settings) { return settings.sac.eval_episodes; },
          .noise = [](const AlgorithmSettings&) { return ActionNoise::kMean; },
          .check = [](const AlgorithmSettings& settings) { settings.sac.CheckLearns("sac"); },
          .train =
              [](const AgentJob& job, const AlgorithmSettings& settings, TrainingDevice device) {
                SacConfig config = settings.sac;
                config.device = device;
                return Trained(TrainAgent(job, config));
              }};
}

AlgorithmEntry CrossQ() {
  return {.algorithm = AgentAlgorithm::kCrossq,
          .name = "crossq",
          .title = "CrossQ",
          .discrete_actions = false,
          .fields = [](AlgorithmSettings& settings) { return settings.crossq.Fields(); },
          .n_steps = [](const AlgorithmSettings& settings) { return settings.crossq.n_steps; },
          .eval_episodes = [](const AlgorithmSettings& settings) { return settings.crossq.eval_episodes; },
          .noise = [](const AlgorithmSettings&) { return ActionNoise::kMean; },
          .check = [](const AlgorithmSettings& settings) { settings.crossq.CheckLearns("crossq"); },
          .train =
              [](const AgentJob& job, const AlgorithmSettings& settings, TrainingDevice device) {
                CrossQConfig config = settings.crossq;
                config.device = device;
                return Trained(TrainAgent(job, config));
              }};
}

AlgorithmEntry Ppo() {
  return {.algorithm = AgentAlgorithm::kPpo,
          .name = "ppo",
          .title = "PPO",
          .discrete_actions = true,
          .fields = [](AlgorithmSettings& settings) { return settings.ppo.Fields(); },
          .n_steps = [](const AlgorithmSettings& settings) { return settings.ppo.n_steps; },
          .eval_episodes = [](const AlgorithmSettings& settings) { return settings.ppo.eval_episodes; },
          .noise = [](const AlgorithmSettings& settings) { return settings.ppo.evaluate; },
          .check = [](const AlgorithmSettings&) {},
          .train = [](const AgentJob& job, const AlgorithmSettings& settings,
                      TrainingDevice) { return Trained(TrainAgent(job, settings.ppo)); }};
}

}  // namespace

std::span<const AlgorithmEntry> Algorithms() {
  static const AlgorithmEntry entries[] = {Sac(), CrossQ(), Ppo()};
  return entries;
}

const AlgorithmEntry& EntryOf(AgentAlgorithm algorithm) {
  return *std::ranges::find(Algorithms(), algorithm, &AlgorithmEntry::algorithm);
}

}  // namespace oted
