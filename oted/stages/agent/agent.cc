#include "oted/stages/agent/agent.h"

#include "oted/base/error.h"

namespace oted {

SacResult TrainAgent(const SimulatorFactory& factory, const std::vector<std::vector<double>>& modes,
                     const SacConfig& config, RngKey key, const std::filesystem::path& folder,
                     const std::string& run_name, const RunContext& context) {
  OTED_CHECK(!modes.empty());
  // Line 1: sample i ~ U[1, n] and set the simulator to z_i. Lines 2 and 3, run and update, are SAC's own loop.
  const auto draw_mode = [&](Rng& rng) { return modes[rng.Below(modes.size())]; };
  return TrainSac(factory, draw_mode, modes, config, key, folder, run_name, context);
}

}  // namespace oted
