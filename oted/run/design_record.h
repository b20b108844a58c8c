#pragma once
/// What a run says of its design: design.json, and growth.json of the designs that look for what its parameters lack.

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "oted/matching/fit_evidence.h"
#include "oted/matching/verdict.h"
#include "oted/stages/design/method_choice.h"
#include "oted/stages/simulator_selection/simulator_selection.h"

namespace oted {

class RecordReader;

nlohmann::json SuspectsToJson(const std::vector<Suspect>& suspects);
std::vector<Suspect> SuspectsFrom(const RecordReader& reader, const char* field);

/// growth/ROUND/growth.json: a design that was made to find what its parameters lack.
struct GrowthRecord {
  static constexpr const char* kSchema = "oted.growth/1";
  /// Empty where the design leaves no more than the sensors explain, or ends at a bound.
  std::vector<Suspect> suspects;
  std::vector<std::string> at_bounds = {};  ///< parameters that end at one
  /// Columns of the logs that no parameter makes right, a sentence each. A suspect would stand in for them.
  std::vector<std::string> wrong_columns = {};

  /// What joins the parameters; null where nothing does.
  const Suspect* Freed() const;
  /// What might have joined in its place (RivalsOfBest).
  std::vector<const Suspect*> Rivals() const;
  nlohmann::json ToJson() const;
  static GrowthRecord FromJson(const nlohmann::json& record, const std::string& where);
};

/// What a round of --grow added, and what explained the logs as well.
struct Disputed {
  const Suspect *added, *rival;
};
/// Those that no later round added as well: with both searched, nothing is disputed. They point into `growth`.
std::vector<Disputed> DisputedIn(const std::vector<GrowthRecord>& growth);

/// design.json: what the design found and how far to trust it.
struct DesignRecord {
  static constexpr const char* kSchema = "oted.design/1";
  /// As Condition, of what is not searched.
  struct RestsOn {
    std::string name, field;
    double off = 0, value = 0;
    std::string condition;  ///< ConditionInWords
  };
  struct Parameter {
    std::string name, field, unit;
    double nominal = 0, low = 0, high = 0;  ///< z
    bool logarithmic = false;               ///< searched on a log scale
    double mode = 0, std = 0;               ///< of the best-scoring seed; spread over all seeds
    double interval90_low = 0, interval90_high = 0;
    ParameterVerdict verdict = ParameterVerdict::kNotIdentified;
    std::vector<RestsOn> rests_on = {};
    bool either_side = false;  ///< the logs are as likely with the negative of its value
  };
  struct Member {
    int seed = 0;
    std::vector<double> mode, std;
  };
  struct Channel {
    std::string name;
    double noise_std = 0, short_noise_std = 0, long_noise_std = 0;
    bool disagrees = false;
  };
  /// What is not searched and should differ by the logs.
  struct Suspected {
    Suspect suspect;
    std::string sentence;  ///< what the logs say of it, and what freeing it bought
    std::string line;      ///< that adds it to the parameters of a task file
  };
  /// Designs from logs that the designed simulator made.
  struct OwnLogs {
    std::vector<std::vector<double>> found;  ///< z by each
    std::string sentence;
  };
  struct Fit {
    int window = 0;
    double explained = 0;
    std::vector<Channel> channels;
    std::vector<Suspected> suspects;
    std::optional<LeftOutInTurn> left_out = {};
    std::optional<OwnLogs> own_logs = {};
  };
  /// How the design predicts logs that it did not see, open loop. The designed simulator here is one that was fitted to
  /// the other logs alone.
  struct Validation {
    struct Channel {
      std::string name, unit;
      double nominal = 0, designed = 0;  ///< root mean square error over the horizon [unit]; NaN: broke down
      double floor = 0;                  ///< what the sensors' noise alone would leave [unit]
      double spread = 0;                 ///< standard deviation over the logs [unit]
      bool judged = true;                ///< HeldOutPrediction::Channel::judged
      double guess = 0;                  ///< HeldOutPrediction::Channel::guess [unit]
      /// So many times the floor's error in all windows together, those that were learned from as well, where some are
      /// far off and most are not; 0 otherwise.
      double times_in_some = 0;
    };
    /// In whole recordings alone, where parts of others judge as well.
    struct InRecordings {
      int n_windows = 0;
      double narrowed = 0;
      bool surely_better = false;
    };
    struct Horizon {
      double seconds = 0;  ///< 0 where time has no unit
      int n_steps = 0;     ///< control steps
      int n_windows = 0;
      bool learned = false;  ///< the design learned from these windows: too little could be kept aside
      /// By which share the design's error is less than the nominal simulator's: of root mean squares, the geometric
      /// mean over channels.
      double narrowed = 0;
      bool surely_better = false;  ///< that this is more than chance (IsSure)
      std::vector<Channel> channels;
      std::optional<InRecordings> in_recordings = {};
      double most_times_floor = 1;         ///< MostTimesFloor
      std::vector<int> odd_episodes = {};  ///< HeldOutPrediction::Horizon::odd_episodes
    };
    std::vector<Horizon> horizons;
    std::optional<Horizon> longest = {};  ///< HeldOutPrediction::longest; without a floor
    int n_recordings = 0, n_parts = 0;    ///< that judge (HeldOutPrediction)
  };
  struct Seed : Member {
    std::optional<double> common;                ///< none where no judge was asked (SelectSimulator)
    std::optional<double> c, learning_progress;  ///< only of Algorithm 1
  };
  struct Setting {
    std::string name, method;
    double design_deviation = 0;
    std::optional<double> common, c, learning_progress;  ///< likewise
    std::vector<Seed> seeds;
  };
  struct Source {
    std::string path, sha256;
    int n_transitions = 0;
  };

  std::string task;
  std::vector<std::string> warnings;
  bool columns_seem_wrong = false;  ///< a warning says of which
  /// That the control period is the task's word, where logs hold neither times nor a velocity with its position; else
  /// empty.
  std::string period_sentence;
  std::vector<Parameter> parameters;
  std::vector<std::vector<double>> correlation;
  std::string selected;         ///< setting
  std::vector<Member> mixture;  ///< its seeds: the simulators that agents train in
  std::optional<double> score;  ///< the selected setting's, by `score_name`; none where it has none
  SelectionScore score_name = SelectionScore::kCommon;
  DesignVerdict verdict = DesignVerdict::kNoGap;
  std::string sentence;  ///< the verdict, with its figures (VerdictSentence)
  /// Whether the design surely predicts better than the nominal simulator; nothing else is exported by default, nor is
  /// it where there is no gap.
  bool predicts_better = false;
  std::optional<Fit> fit;
  std::vector<Suspect> grown;  ///< what design.grow added to the parameters, in this order
  /// Whether `parameter` is one of these.
  bool WasGrown(const std::string& parameter) const;
  std::optional<Validation> validation;      ///< none where nothing can be predicted
  std::vector<MethodChoice> method_choices;  ///< of settings whose method was left to auto
  std::optional<double> nominal_common;      ///< none where no judge was asked
  std::vector<Setting> settings;
  Source dataset;
  std::string model_sha256;
  std::string inputs;  ///< InputsFingerprint
  std::string oted_version, mujoco_version;
  std::string fingerprint;  ///< as read; written by the run directory

  std::vector<double> BestMode() const;
  std::vector<std::vector<double>> MixtureModes() const;
  nlohmann::json ToJson() const;
  static DesignRecord FromJson(const nlohmann::json& record, const std::string& where);
};
nlohmann::json ValidationToJson(const DesignRecord::Validation& validation);

}  // namespace oted
