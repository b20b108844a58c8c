#pragma once
/// How simulators predict logs, open loop, beside what the sensors' noise alone would leave: what verdicts rest on.

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

namespace oted {

/// A number with its standard error.
struct Estimated {
  double value = 0, error = 0;
};

/// Errors of the nominal simulator, of a designed one, and the floor: those that the designed simulator leaves when it
/// predicts, in the same way, logs that it made itself, with the sensors' noise on them.
///
/// Gains and excesses are logarithms of ratios of mean squares; of a horizon, the mean over its channels. Squares count
/// at most the channel's variance over the logs (what is farther off is no nearer than a guess), and kVisibleError of
/// its spread is added to both sides of a ratio: below it, errors are nobody's concern.
struct HeldOutPrediction {
  struct Channel {
    /// Root mean square errors up to the horizon, in the channel's unit. NaN where the physics broke down.
    double nominal = 0, designed = 0, floor = 0;
    double spread = 0;  ///< standard deviation of the channel over the logs: the error of guessing its mean
    /// Whether it has a part in what is told of all channels. Velocities that were computed from positions, or that a
    /// drive shows late, have none: their errors are not the simulator's. Their gain and excess are 0.
    bool judged = true;
    /// Of the designed simulator over the floor, in these windows and in those that it learned from: in a typical one,
    /// or of sums over all of them where some are far off and most are not (`in_some`).
    Estimated excess;
    Estimated gain;  ///< of the designed simulator over the nominal one: of sums over the windows
    /// The least error of three guesses that know no simulator: its mean over the logs, that it stays as it was last
    /// read, that it goes on along a line through the readings that a start is fitted to.
    double guess = 0;
    bool in_some = false;
  };
  struct Horizon {
    double seconds = 0;  ///< 0 where time has no unit
    int n_steps = 0;     ///< control steps
    int n_windows = 0;   ///< that errors and gain are of
    /// The design learned from these windows: none that was kept aside is long enough. Else they were kept aside.
    bool learned = false;
    std::vector<Channel> channels;
    Estimated excess, gain;
    Estimated typical_gain = {};  ///< in a typical window: `gain` is of sums, which one seam of a log may fill
    /// Episodes of the logs, from 0, whose windows are far off, as those of most are not, the farthest
    /// first (FindOddEpisodes).
    std::vector<int> odd_episodes = {};
    bool surely_odd = false;            ///< one of them is, by more than chance
    int n_of_recordings = 0;            ///< windows in whole recordings, where parts of others judge as well,
    Estimated gain_of_recordings = {};  ///< and the gain in these alone
  };
  std::vector<Horizon> horizons;  ///< in ascending order; at least one
  /// How far replays can be followed at all (longest_horizon.h): the longest horizon beyond these over which either
  /// simulator's error is below half of a guess's, and in no channel as large. No verdict rests on it, and no floor is
  /// looked for: floor and excess are 0.
  std::optional<Horizon> longest = {};

  /// What was kept aside: whole recordings, and parts of those that the design learned from, whose motions it has seen.
  /// Both 0: nothing was.
  int n_recordings = 0, n_parts = 0;

  /// A parameter that may be a quarter of its range higher, or lower, than the design's: the logs are not surely
  /// predicted worse. However steep the fit's cost, they do not show that end of its interval.
  struct OpenEnd {
    int parameter = 0;
    bool above = false;
  };
  std::vector<OpenEnd> open_ends;
};
inline constexpr double kVisibleError = 1e-3;
inline constexpr double kFarOff = 1.4;  ///< an excess that no more windows make a small one: twice the floor's error

/// Whether a horizon is one that verdicts tell of: up to half a second; the shortest, where time has no unit.
template <class Horizon>
bool IsTold(const Horizon& horizon) {
  constexpr int kShortest = 2;  // control steps
  return horizon.seconds > 0 ? horizon.seconds <= 0.5 + 1e-9 : horizon.n_steps <= kShortest;
}

/// The horizon that is told of: the longest (IsTold), of logs that were kept aside if there is one; otherwise the
/// first.
/// @param horizons  in ascending order, at least one, each with `seconds`, `n_steps` and `learned`
template <class Horizons>
const auto& ToldOf(const Horizons& horizons) {
  const auto* told = &horizons.front();
  for (const auto& h : horizons) {
    if (IsTold(h) && (told->learned || !h.learned)) told = &h;
  }
  return *told;
}

/// So many times the floor's error the design's may be: two standard errors above the excess, or as many times as the
/// sums over these windows say, in the geometric mean over channels. Where few windows are far off and the others are
/// not, the excess of a typical one hides what chance may have made, and may not.
double MostTimesFloor(const HeldOutPrediction::Horizon& horizon);

nlohmann::json ToJson(const Estimated& estimated);
/// @throws nlohmann::json::exception when a member is missing
Estimated EstimatedFromJson(const nlohmann::json& record);
nlohmann::json ToJson(const HeldOutPrediction& prediction);
/// @throws nlohmann::json::exception when a member is missing
HeldOutPrediction HeldOutPredictionFromJson(const nlohmann::json& json);

}  // namespace oted
