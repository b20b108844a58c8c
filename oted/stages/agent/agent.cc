#include "oted/stages/agent/agent.h"

#include <utility>

#include "oted/base/error.h"

namespace oted {

EpisodeParameters DrawModes(std::vector<std::vector<double>> modes) {
  OTED_CHECK(!modes.empty());
  return [modes = std::move(modes)](Rng& rng) { return modes[rng.Below(modes.size())]; };
}

EpisodeParameters DrawSamples(std::vector<Designer> q) {
  OTED_CHECK(!q.empty());
  return [q = std::move(q)](Rng& rng) { return q[rng.Below(q.size())].Draw(rng).z; };
}

ReplayAgent TrainAgent(const SimulatorFactory& factory, EpisodeSource& where,
                       const std::vector<std::vector<double>>& evaluate_in, const SacConfig& config, RngKey key,
                       const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                       const EvaluationObserver& observer) {
  return TrainSac(factory, where, evaluate_in, config, key, folder, run_name, context, observer);
}

ReplayAgent TrainAgent(const SimulatorFactory& factory, EpisodeSource& where,
                       const std::vector<std::vector<double>>& evaluate_in, const CrossQConfig& config, RngKey key,
                       const std::filesystem::path& folder, const std::string& run_name, const RunContext& context,
                       const EvaluationObserver& observer) {
  return TrainCrossQ(factory, where, evaluate_in, config, key, folder, run_name, context, observer);
}

PpoResult TrainAgent(const SimulatorFactory& factory, EpisodeSource& where,
                     const std::vector<std::vector<double>>& evaluate_in, const PpoConfig& config, RngKey key,
                     const std::filesystem::path& folder, const std::string& run_name, const RunContext& context) {
  return TrainPpo(factory, where, evaluate_in, config, key, folder, run_name, context);
}

}  // namespace oted
