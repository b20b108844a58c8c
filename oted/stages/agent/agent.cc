#include "oted/stages/agent/agent.h"

#include "oted/base/error.h"

namespace oted {

namespace {

/// Line 1: sample i ~ U[1, n] and set the simulator to z_i. Lines 2 and 3, run and update, are the algorithm's own
/// loop.
EpisodeParameters DrawMode(const std::vector<std::vector<double>>& modes) {
  OTED_CHECK(!modes.empty());
  return [&modes](Rng& rng) { return modes[rng.Below(modes.size())]; };
}

}  // namespace

SacResult TrainAgent(const SimulatorFactory& factory, const std::vector<std::vector<double>>& modes,
                     const SacConfig& config, RngKey key, const std::filesystem::path& folder,
                     const std::string& run_name, const RunContext& context) {
  return TrainSac(factory, DrawMode(modes), modes, config, key, folder, run_name, context);
}

PpoResult TrainAgent(const SimulatorFactory& factory, const std::vector<std::vector<double>>& modes,
                     const PpoConfig& config, RngKey key, const std::filesystem::path& folder,
                     const std::string& run_name, const RunContext& context) {
  return TrainPpo(factory, DrawMode(modes), modes, config, key, folder, run_name, context);
}

}  // namespace oted
