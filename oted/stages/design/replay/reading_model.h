#pragma once
/// What the readings of a log say of the simulator's state, and what they do not.

#include <Eigen/Dense>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/replay/local_rates.h"

namespace oted {

inline constexpr double kStartStep = 1e-5;  ///< of forward differences, over how far a coordinate spreads

/// How readings are held to a replay whose start is fitted. A start has the coordinates of a state
/// (SimulatorSpec::state_dim). Those that its first reading does not show are *unread*: velocities that nobody
/// measured, what a lagging sensor shows, readings that were computed from others. They have a wide prior about a
/// guess.
struct ReadingModel {
  /// Every reading is held, and a start has no other coordinates.
  static ReadingModel Plain(int obs_dim);
  /// @param computed  (obs_dim): nonzero for readings to leave out (ComputedReadings); empty: none
  static ReadingModel Of(const SimulatorSpec& spec, const Dataset& dataset, const std::vector<char>& computed = {});

  int obs_dim() const { return static_cast<int>(ages.size()); }
  int state_dim() const { return static_cast<int>(state_scale.size()); }
  /// (state_dim): by which starts are moved for their derivatives.
  Eigen::VectorXd StartStep() const { return kStartStep * state_scale; }
  int n_unread() const { return static_cast<int>(unread.size()); }
  /// Whether the reading of a channel, t steps behind the start, is held to the replay.
  bool IsHeld(int channel, int t) const {
    return t >= ages[static_cast<size_t>(channel)] && computed[static_cast<size_t>(channel)] == 0;
  }
  /// (n_steps + 1, obs_dim) row by row, then the unread coordinates: 1 where a residual counts, else 0.
  Eigen::VectorXd Held(int n_steps) const;
  int longest_age() const;
  /// Control steps of the shortest windows that tell anything: two where a reading shows the state, four where rates
  /// are unread, and as many more as a reading may be late.
  int ShortestWindow() const { return (unread.empty() ? 2 : 4) + longest_age(); }
  /// Whether every coordinate of a state is read when it is so.
  bool ShowsState() const { return unread.empty() && longest_age() == 0; }
  /// The state at a logged row, as far as the logs suggest it.
  Eigen::VectorXd Guess(const SimulatorSpec& spec, const Dataset& dataset, LocalRates& rates, int row) const;

  std::vector<int> ages;         ///< (obs_dim): as SimulatorSpec::reading_ages
  std::vector<char> computed;    ///< (obs_dim)
  Eigen::VectorXd smallest_std;  ///< (obs_dim): the noise that a reading's own steps make
  Eigen::VectorXd state_scale;   ///< (state_dim): how far each coordinate spreads over the logs
  std::vector<int> unread;       ///< coordinates of the state, ascending
  std::vector<char> guessed;     ///< (unread): nonzero where the logs suggest a value; elsewhere the guess is `mean`
  Eigen::VectorXd mean, std;     ///< (unread): `std` is that of the prior about the guess
};

/// Standard deviation of the error that a channel's resolution makes, step / sqrt(12), per channel: an encoder's
/// counts, or the digits of a text file. 0 where readings hardly ever repeat.
Eigen::VectorXd QuantisationNoise(const Dataset& dataset);

/// (obs_dim): nonzero for rates that show surely later than the positions that they belong to, by three quarters of a
/// row or more: a drive filters or queues them. Not of a channel whose delay is known or searched
/// (SimulatorSpec::reading_ages).
std::vector<char> LateReadings(const SimulatorSpec& spec, const Dataset& dataset);

/// (obs_dim): nonzero for rates that were computed from logged positions (differences, smoothed differences): a linear
/// combination of the positions around gives them to a tenth of their noise. They say nothing that the positions do
/// not, and their noise is not white.
/// @param told  (obs_dim): standard deviations of the noise, as told by a fit; LargestNoise is an upper bound of them
std::vector<char> ComputedReadings(const SimulatorSpec& spec, const Dataset& dataset, const Eigen::VectorXd& told);

/// (obs_dim): nonzero for readings that a fit leaves out and nobody is judged by: computed and late ones.
/// @param noise  what ComputedReadings is told
std::vector<char> ReadingsLeftOut(const SimulatorSpec& spec, const Dataset& dataset, const Eigen::VectorXd& noise);

}  // namespace oted
