#pragma once
/// Which changes of the log's columns are worth trying.

#include <vector>

#include "oted/checks/correction.h"
#include "oted/checks/short_replays.h"

namespace oted {

inline constexpr double kGoodError = 0.03;  ///< of a channel, of its change: below it nothing is to be mended
inline constexpr size_t kMostAskedJoints = 12;

/// A position and its rate, where that is logged.
struct LoggedJoint {
  int position = 0;
  int velocity = -1;
  bool agree = true;
  bool correlated = true;  // one goes with the other, whatever the factor
  std::vector<int> Channels() const {
    return velocity < 0 ? std::vector<int>{position} : std::vector<int>{position, velocity};
  }
};

/// @param guesses_rates  whether windows begin at rates that nobody logged: their positions count as well
std::vector<LoggedJoint> JointsOf(const Dataset& dataset, const SimulatorSpec& spec, bool guesses_rates);

/// What could be wrong with channels that are predicted badly.
/// @param now  what the windows miss of each channel
std::vector<Correction> CandidateCorrections(const SimulatorSpec& spec, const ReplayedWindows& windows,
                                             const std::vector<LoggedJoint>& joints, const ChannelErrors& now);

}  // namespace oted
