#pragma once
/// How near simulators come to logged episodes that no design has learned from.

#include <vector>

#include "oted/data/dataset.h"
#include "oted/matching/fit_evidence.h"
#include "oted/sim/simulator.h"

namespace oted {

struct HeldOutErrors {
  int n_steps = 0;    ///< control steps of the windows
  int n_windows = 0;  ///< that were compared; 0 where no state of the logs can be set
  int overlap = 1;    ///< windows that share a reading: that many count as one
  /// Per simulator and window: the root mean square over readings and channels, in units of each channel's noise, or of
  /// a hundredth of its spread over the logs where that is more: finer differences are nobody's concern. About 1 where
  /// noise alone is left; at most kBrokenDownError, which stands for physics that broke down.
  std::vector<std::vector<double>> of;
};
inline constexpr double kBrokenDownError = 1e6;

/// Windows of `held_out`, of up to 10 control steps, are replayed with the logged actions in the
/// simulator at every one of `z`. A noisy reading is no state, and predictions from it favour simulators that forget
/// their start: each window begins where its replay follows the readings best, noise considered, as trajectory matching
/// has it. What is left is what that simulator cannot explain.
/// @param fit  the noise of every channel (what the shortest windows of a fit left) and its spread
HeldOutErrors ReplayHeldOut(const SimulatorFactory& factory, const Dataset& held_out,
                            const std::vector<std::vector<double>>& z, const FitEvidence& fit, int n_threads);

}  // namespace oted
