#pragma once
/// Constants of a model that may be off in place of a log's columns.

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "oted/checks/short_replays.h"
#include "oted/sim/simulator.h"

namespace oted {

/// A constant of the model, with another value than the model's.
struct ParameterRival {
  std::string words;  ///< "actuator/*/kp x 0.7", "joint/elbow/springref at 0.25"
  double error = 0;   ///< mean of ChannelErrors over the channels that it was chosen by
};

/// Tries what is often off in such a model (SimulatorFactory::Suspects), one constant after another, each with a few
/// factors; of a spring that the model lacks, a few shares of what may be; of where a spring rests, something stands or
/// a centre of mass lies, a few places. The best of them is then refined. None where the simulator knows no suspects.
class ParameterRivals {
 public:
  ParameterRivals(const SimulatorFactory& factory, int n_threads);

  /// That which predicts these channels best, in every `stride`-th window; none where all leave more than `most`.
  std::optional<ParameterRival> Best(const ReplayedWindows& windows, const std::vector<int>& judged, double most,
                                     size_t stride);

 private:
  std::unique_ptr<SimulatorFactory> wider_;  // null: no suspects
  std::optional<ShortReplays> replays_;
};

}  // namespace oted
