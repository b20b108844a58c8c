#pragma once
/// What a fit of the logs leaves unexplained.

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace oted {

/// Something that is not searched and that the logs ask to be other than it is.
struct Suspect {
  std::string field;   ///< its path, as a parameter's
  double factor = 1;   ///< times its nominal value, told by a linear model
  double log_std = 0;  ///< standard deviation of log(factor)
};

/// Open-loop prediction of logs that the parameters were not fitted to: root mean square errors per observation
/// channel, in its own unit.
struct HeldOutPrediction {
  struct Horizon {
    double seconds = 0;
    std::vector<double> nominal, designed;  ///< (obs_dim)
  };
  int n_windows = 0;
  std::vector<Horizon> horizons;
};

/// Residuals of replayed windows at the fitted parameters and start states, per observation channel in its own unit.
struct FitEvidence {
  int window = 0;                 ///< control steps of the longest windows that the estimate rests on
  double explained = 0;           ///< share of those windows that the simulator explains; the others count less
  std::vector<double> noise_std;  ///< (obs_dim): of the logged observations
  std::vector<double> scale;      ///< (obs_dim): how far the channel spreads over the logs
  /// (obs_dim): what the shortest windows leave as noise, and the longest that were tried. In the logs' own simulator
  /// the two are equal up to chance; what a simulator has wrong adds up over a window.
  std::vector<double> short_noise_std, long_noise_std;
  /// Each would, changed alone, explain part of what is left; the most certain first.
  std::vector<Suspect> suspects;
  std::optional<HeldOutPrediction> held_out = {};  ///< none where the logs are too short to keep a part aside
};

nlohmann::json ToJson(const std::vector<Suspect>& suspects);
nlohmann::json ToJson(const FitEvidence& evidence);
/// @throws nlohmann::json::exception when a member is missing
FitEvidence FitEvidenceFromJson(const nlohmann::json& json);

}  // namespace oted
