#include "oted/checks/parameter_rivals.h"

#include <algorithm>
#include <array>

#include "oted/sim/channel_path.h"

namespace oted {
namespace {

constexpr std::array<double, 4> kFactors = {0.5, 0.7, 1.4, 2.0};

bool IsMultiple(const ParameterSpec& spec) { return spec.IsMultiple() && !IsChannelPath(spec.field); }

}  // namespace

ParameterRivals::ParameterRivals(const SimulatorFactory& factory, int n_threads) {
  std::vector<ParameterSpec> suspects = factory.Suspects();
  std::erase_if(suspects, [](const ParameterSpec& spec) { return !IsMultiple(spec); });
  if (suspects.empty()) return;
  wider_ = factory.With(suspects);
  if (wider_ != nullptr) replays_.emplace(*wider_, n_threads);
}

std::optional<ParameterRival> ParameterRivals::Best(const ReplayedWindows& windows, const std::vector<int>& judged,
                                                    double most, size_t stride) {
  if (!replays_) return std::nullopt;
  const ParameterSpace& space = wider_->parameters();
  std::optional<ParameterRival> best;
  for (int i = 0; i < space.size(); ++i) {
    if (!IsMultiple(space[i])) continue;  // a parameter that is searched may be none
    for (const double factor : kFactors) {
      std::vector<double> z = space.Nominal();
      double& value = z[static_cast<size_t>(i)];
      value = std::clamp(factor * value, space[i].low, space[i].high);
      replays_->SetParameters(z);
      const std::optional<ChannelErrors> errors = replays_->Errors(windows, stride);
      if (!errors) continue;
      const double error = MeanOf(*errors, judged);
      if (error < (best ? best->error : most)) best = {space[i].field, value / space[i].nominal, error};
    }
  }
  return best;
}

}  // namespace oted
