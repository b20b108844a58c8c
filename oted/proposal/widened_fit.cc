#include "oted/proposal/widened_fit.h"

#include <algorithm>

#include "oted/sim/channel_path.h"

namespace oted {
namespace {

constexpr double kAtEnd = 0.9;  // of a range, from where on it is too narrow
constexpr double kWider = 4, kWiderDelay = 3, kWiderMultiple = 2;
constexpr double kLowestMultiple = 0.2, kHighestMultiple = 5;
constexpr int kWidenings = 2;

/// @param unit  where in the candidate's range the fit ended
/// @return whether that was too narrow, and is wider now
bool Widen(ParameterSpec& candidate, double unit) {
  const bool is_delay = candidate.field == kDelayPath;
  if (IsChannelPath(candidate.field) && !is_delay) return false;
  const double low = candidate.low, high = candidate.high;
  if (candidate.scale == ParameterScale::kAbsolute) {
    const double wider = is_delay ? std::min(kWiderDelay * high, kMostDelay) : kWider * high;
    if (unit >= kAtEnd) candidate.high = wider;
  } else if (candidate.logarithmic) {
    if (unit >= kAtEnd) candidate.high = std::max(high, std::min(kWiderMultiple * high, kHighestMultiple));
    if (unit <= 1 - kAtEnd) candidate.low = std::min(low, std::max(low / kWiderMultiple, kLowestMultiple));
  }
  return candidate.low != low || candidate.high != high;
}

}  // namespace

std::optional<TrialFit> FitWidened(
    std::vector<ParameterSpec>& candidates, const Dataset& dataset, RngKey key, const RunContext& context,
    const std::function<std::unique_ptr<SimulatorFactory>(const std::vector<ParameterSpec>&)>& remake) {
  for (int round = 0;; ++round) {
    const auto factory = remake(candidates);
    std::optional<TrialFit> trial = FitBriefly(*factory, dataset, key, context, round == 0 ? "fit" : "refit");
    if (!trial || round == kWidenings) return trial;
    const std::vector<double> unit = factory->parameters().ToUnit(trial->z);
    bool widened = false;
    for (size_t i = 0; i < candidates.size(); ++i) widened = Widen(candidates[i], unit[i]) || widened;
    if (!widened) return trial;
  }
}

}  // namespace oted
