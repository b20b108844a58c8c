#pragma once
/// Stage 3 (paper, Sec. 4.2, "Simulator selection"): which hyperparameter setting h designed the best simulators?

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "oted/base/fields.h"
#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/matching/designer.h"
#include "oted/matching/discriminator.h"
#include "oted/matching/fit_evidence.h"
#include "oted/matching/held_out_prediction.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"

namespace oted {

/// What ranks the settings.
enum class SelectionScore {
  kCommon,            ///< "common": the common judge's
  kPaper,             ///< "paper": the paper's c
  kDesignDeviation,   ///< "design_deviation"
  kLearningProgress,  ///< "learning_progress"
};
const NamedValues<SelectionScore>& SelectionScoreNames();

struct SelectionConfig {
  int n_seeds = 0;  ///< 0: as many as the setting's method wants
  SelectionScore score = SelectionScore::kCommon;
  int n_sims = 16;
  int n_steps = 200;
  int judge_steps = 400;

  FieldList Fields();
};

/// One design: hyperparameters h with seed i, and what it learned.
struct Candidate {
  std::string setting;
  std::string method;  ///< design.method of the setting
  int seed = 0;
  Designer q;
  std::optional<Discriminator> g;           ///< only of Algorithm 1; likewise the next two
  EvidenceConfig evidence;                  ///< that g was trained on
  std::optional<double> learning_progress;  ///< mean of -log(1 - g) during training, whatever the reward is
  std::shared_ptr<const Policy>
      clone;                       ///< of the design itself, where clone and design were trained jointly; else null
  std::optional<FitEvidence> fit;  ///< what the design's fit left unexplained; only of methods that replay windows
  std::optional<HeldOutPrediction> prediction;  ///< how q predicts logs; only of designs that a verdict is asked of
  bool superseded = false;  ///< scored, but its setting is not selected: another method was preferred
};

/// What candidates are judged by.
struct SimulatorSelectionJob {
  const SimulatorFactory& factory;
  const Dataset& dataset;
  const Policy* clone;  ///< may be null where every candidate's evidence replays actions and states can be set
  const SelectionConfig& config;
  RngKey key;
  RunContext context;
};

struct CandidateScore {
  std::optional<double> c;  ///< the paper's c(h_i): mean -log(1 - g) on fresh rollouts with z ~ q, by the design's g
  /// Held-out Eq. 2 / 2 of a judge that every candidate gets anew; log 2 at a perfect match. None of a lone candidate
  /// that its predictions judge.
  std::optional<double> common;
};

struct SettingScore {
  std::string setting;
  std::vector<int> candidates;   ///< indices into the candidates
  std::optional<double> c;       ///< mean over seeds; highest wins; none where the design left no g
  std::optional<double> common;  ///< mean over seeds; highest wins; none where no judge was asked
  double design_deviation =
      0;  ///< standard deviation of the modes over seeds, in ranges, mean over parameters; lowest wins
  std::optional<double> learning_progress;  ///< mean over seeds; highest wins; likewise
  int best_candidate = 0;                   ///< the best-scoring of its seeds
};

struct SelectionResult {
  std::vector<CandidateScore> candidates;
  std::vector<SettingScore> settings;
  int selected_setting = 0;  ///< index into settings, by config.score
  int best_candidate = 0;    ///< of the selected setting
  /// The common score of the nominal simulator: is there a gap at all? None where no judge was asked.
  std::optional<double> nominal_common;
};

/// @throws UsageError where `score` ranks by what only Algorithm 1 leaves, and a setting's method is another
void CheckSelectionScore(SelectionScore score, const std::string& setting, const std::string& method,
                         bool is_algorithm1);

/// Not of one candidate that predictions judge: there is nothing to rank. One with a g is scored all the same.
bool AsksCommonJudge(const std::vector<Candidate>& candidates);

/// Scores of differently strong discriminators are not comparable (a blind g gives log 2 on any simulator), so beside
/// the paper's c every candidate is judged by one common protocol: a fresh discriminator, trained on one half of the
/// dataset and of new rollouts, tested on the other half, and the reverse (docs/deviations.md#common-score), where that
/// is asked (AsksCommonJudge).
/// @param candidates  at least one; their g are evaluated; all have one where the score is the paper's or learning
///                    progress (CheckSelectionScore)
SelectionResult SelectSimulator(const SimulatorSelectionJob& job, std::vector<Candidate>& candidates);

}  // namespace oted
