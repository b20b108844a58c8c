#pragma once
/// What a fit of the logs leaves unexplained.

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "oted/matching/held_out_prediction.h"
#include "oted/matching/logits.h"
#include "oted/sim/parameter_space.h"

namespace oted {

/// What a design gained where a suspect was searched as well. Both designs learned from a part of the logs; they are
/// judged on the same windows of the rest, over one horizon.
struct FreedTrial {
  double value = 0, std = 0;  ///< z of what was freed
  /// What the logs then say of the parameters beside it: central 90 % intervals of z, in their order.
  std::vector<SearchInterval> intervals90;
  /// It predicts better, by two standard errors, and at no other horizon surely worse. Or it predicts no worse (better,
  /// where the design's windows are long ones) and makes windows likelier by two standard errors. Never where it, or a
  /// parameter beside it, is at an end of its range.
  bool kept = false;
  double seconds = 0;  ///< the horizon; 0 where time has no unit
  int n_steps = 0, n_windows = 0;
  bool learned = false;  ///< the windows are of the logs that the designs learned from: no others are long enough
  Estimated gain;        ///< as HeldOutPrediction's, over the design without it
  /// By which windows become likelier, their starts fitted: of the logs that were kept aside and, where the design's
  /// windows are short ones and those agree, of the others too. None where nothing was kept aside.
  std::optional<Estimated> nats;
  /// Other suspects, by name, with which the same windows surely become likelier still; or which surely predict better,
  /// where that is not known of both.
  std::vector<std::string> led_by;
  /// (obs_dim): root mean square errors without it and with it, in the channel's unit. NaN where the physics broke
  /// down.
  std::vector<double> before, after;
};

inline constexpr double kFewestSureNats = 8.0;  ///< as much as four standard deviations of one number
inline constexpr double kSureErrors = 2.0;      ///< standard errors, of what a trial gains

/// Whether windows surely become likelier.
bool IsLikelier(const FreedTrial& trial);

/// Something that is not searched and that the logs ask to be other than it is.
struct Suspect {
  ParameterSpec spec;                              ///< as it would be searched
  double value = 1;                                ///< z by windows of the logs
  double explains = 0;                             ///< nats by which these windows become likelier
  std::optional<FreedTrial> trial = std::nullopt;  ///< none where it was not freed
  /// Whether the logs surely ask for it: the windows that named it, or those that it was freed by.
  bool IsLikely() const { return explains > kFewestSureNats || (trial && trial->kept); }
};

/// What a parameter's value rests on: something that is not searched, and that the logs cannot tell from it.
struct Condition {
  int parameter = 0;   ///< of the searched ones
  ParameterSpec spec;  ///< what is not searched, as it would be
  double off = 1;      ///< z of that: a tenth more than nominal, of its value or of its range; a rotor's is twice
  double value = 0;    ///< z of the parameter, were it so: by a linear model
};

/// A value that may as well be its negative: the logs do not tell on which side of 0 it lies.
struct MirroredValue {
  int parameter = 0;                   ///< of the searched ones
  SearchInterval interval90 = {0, 0};  ///< of z, on the other side
};

/// What predictions of the logs that were kept aside start from.
struct UnseenFit {
  std::vector<double> z;  ///< fitted to the other logs alone; empty where none could be kept aside
  /// As ReadingModel's: readings that were left out, and what is expected of coordinates that no reading shows.
  std::vector<char> computed;
  std::vector<double> mean, std;
  /// (d * d), row by row, over the search coordinates at z: how far the noise alone may have put z off. Empty with z.
  std::vector<double> covariance;
};

/// A part of the logs, predicted open loop over half a second by a fit that left it out.
struct LeftOutPart {
  double error = 1;  ///< geometric mean over channels of the root mean squares, in multiples of the nominal simulator's
  bool sure = false;               ///< it differs from 1 by more than two standard errors
  std::vector<int> episodes = {};  ///< which ones of the logs it is of, from 0
};

/// All parts of the logs in turn: what a design may expect of a motion that it has not seen.
struct LeftOutInTurn {
  std::vector<LeftOutPart> parts;
  bool recordings = false;  ///< no part holds less than a whole recording
  /// The recordings that are surely predicted worse than by the nominal simulator; none where parts are less than that.
  std::vector<LeftOutPart> WorseRecordings() const;
};

nlohmann::json ToJson(const LeftOutInTurn& left_out);
/// @throws nlohmann::json::exception when a member is missing
LeftOutInTurn LeftOutFromJson(const nlohmann::json& record);

/// Residuals of replayed windows at the fitted parameters and start states, per observation channel in its own unit.
struct FitEvidence {
  int window = 0;                 ///< control steps of the longest windows that the estimate rests on
  double explained = 0;           ///< share of those windows that the simulator explains; the others count less
  std::vector<double> noise_std;  ///< (obs_dim): of the logged observations
  std::vector<double> scale;      ///< (obs_dim): how far the channel spreads over the logs
  /// (obs_dim): what the shortest windows leave as noise, and the longest that were tried. In the logs' own simulator
  /// the two are equal up to chance; what a simulator has wrong adds up over a window.
  std::vector<double> short_noise_std, long_noise_std;
  int rows = 0, logged_rows = 0;               ///< transitions that the estimate rests on, and that there are
  std::optional<UnseenFit> unseen = {};        ///< of methods that keep a part of the logs aside
  bool errors_grow = false;                    ///< over these windows: no simulator of the family explains the logs
  std::optional<LeftOutInTurn> left_out = {};  ///< where lengths of windows were chosen by it
  /// z of designs from logs of the design's own simulator, by the same method; where they lie farther from the design's
  /// than its covariance was, that is as wide as these since then.
  std::vector<std::vector<double>> own_logs = {};
  /// Parameters whose standard deviation these more than double; all of them where rates are unread as well.
  std::vector<int> unsettled = {};
  std::vector<MirroredValue> mirrored = {};
  std::vector<Condition> conditions = {};  ///< of each parameter those that move it most
  /// What the fit's own windows ask to be other than in the model, though their predictions may be as near to the logs
  /// as the sensors let them. By a linear model; the surest first, none of them tried.
  std::vector<Suspect> asked = {};
  /// Noisy windows surely ask for something, be it by a linear model ever so little: what is far off they may take for
  /// noise, and say so little of.
  bool asks_surely = false;
};

nlohmann::json ToJson(const FreedTrial& trial);
/// @throws nlohmann::json::exception when a member is missing
FreedTrial TrialFromJson(const nlohmann::json& record);
nlohmann::json ToJson(const Suspect& suspect);
/// @throws nlohmann::json::exception when a member is missing
Suspect SuspectFromJson(const nlohmann::json& record);
nlohmann::json ToJson(const FitEvidence& evidence);
/// @throws nlohmann::json::exception when a member is missing
FitEvidence FitEvidenceFromJson(const nlohmann::json& json);

}  // namespace oted
