#pragma once
/// Open-loop actions that excite a system: what one logs when there is no policy yet.

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "oted/base/rng.h"
#include "oted/sim/simulator.h"

namespace oted {

/// Which actions. Amplitudes are fractions of half the action range; actions stay within the range.
struct Excitation {
  enum class Kind {
    kRandom,  ///< uniform over the range, anew at every control step
    kNoise,   ///< an Ornstein-Uhlenbeck process around the middle of the range
    kSine,    ///< five sines per action, frequencies log-uniform from 0.1 Hz to an eighth of the control rate
  };
  Kind kind = Kind::kRandom;
  double amplitude = 1;           ///< standard deviation of the noise; of the sines' sum, the most it can reach
  double correlation_time = 0.2;  ///< of the noise [s]

  /// "random", "noise:STD[:SECONDS]", "sine[:AMPLITUDE]"; nothing for any other text, which then names a file.
  /// @throws UsageError for one of these words with numbers that make no sense
  static std::optional<Excitation> Parse(const std::string& text);
};

/// The actions of one episode, one row after the other.
class OpenLoop {
 public:
  OpenLoop(const Excitation& excitation, const SimulatorSpec& spec, RngKey key);
  /// @param action (act_dim)
  void Next(std::span<double> action);

 private:
  struct Sine {
    double frequency, phase;  // [Hz], [rad]
  };
  Excitation excitation_;
  const SimulatorSpec& spec_;
  Rng rng_;
  int step_ = 0;
  std::vector<std::vector<Sine>> sines_;  // per action
  std::vector<double> noise_;             // per action
};

}  // namespace oted
