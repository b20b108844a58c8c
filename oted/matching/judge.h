#pragma once
/// The common judge: how well can a fresh discriminator tell a simulator from the logs, on data that it has not seen?
/// The simulator selection ranks designs by it; the check of data asks it whether there is a gap at all.

#include <vector>

#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/matching/experience.h"
#include "oted/nn/policy.h"
#include "oted/sim/simulator.h"

namespace oted {

/// The two halves that judges are trained and tested on: whole episodes where there are at least two, otherwise the
/// two halves of the one there is.
struct JudgeHalves {
  Dataset part[2];
};
/// @throws DataError of fewer than two transitions
JudgeHalves SplitForJudge(const Dataset& dataset);

/// The strongest evidence that the simulator allows, the same for everything that is to be compared. Of images: how
/// episodes begin (kFirstSteps).
inline constexpr int kFirstSteps = 4;
EvidenceConfig CommonEvidence(const SimulatorSpec& spec, int n_steps);

/// Means over the two halves, each on rows that its judge was not trained on.
struct JudgeScore {
  double common = 0;    ///< Eq. 2 / 2 [nats]; log 2 where nothing can be told apart; 0 without any valid sample
  double auc = 0.5;     ///< chance that a logged row looks more like the logs than a simulated one; 1/2 when blind
  double accuracy = 0;  ///< share on the right side of g = 1/2, mean over both kinds; 1/2 when blind
  int n_data = 0;       ///< logged rows that were judged
  int n_simulated = 0;  ///< simulated rows that were judged
};

/// How rollouts are judged. What it refers to must outlive the call.
struct RolloutJudge {
  const JudgeHalves& halves;
  const Policy* clone;  ///< may be null when `evidence` replays actions
  const EvidenceConfig& evidence;
  int judge_steps;
};

/// Held-out Eq. 2 / 2 of a judge trained on half 0 of data and of simulator samples with parameters `z` (one lane
/// each), tested on half 1, and the reverse. A judge that over-fits would look worse than a blind one: the step at
/// which it tells most counts, a blind start included.
/// @throws DataError when the evidence needs settable states and the simulator or the data have none
JudgeScore JudgeSimulator(const SimulatorFactory& factory, const RolloutJudge& by,
                          const std::vector<std::vector<double>>& z, RngKey key);

/// The judges alone: each trained on `data[h]` and `simulated[h]` (rows of features, none empty), tested on the other.
/// @param shape  what the rows are; by default: quantities
JudgeScore JudgeSamples(const Array2<double> (&data)[2], const Array2<double> (&simulated)[2], int judge_steps,
                        RngKey key, const InputShape& shape = {});

/// Windows of the logs whose first state can be set are replayed with parameters z, one after the other from the list,
/// and the transitions judged against the logged ones of the same windows, row by row the same number: where the
/// simulator is the logs' own, nothing tells them apart, whatever states cannot be set. With the nominal parameters: is
/// there a gap at all?
/// Needs spec().can_set_state. @throws DataError when no state of a half can be set
JudgeScore JudgeReplays(const SimulatorFactory& factory, const JudgeHalves& halves,
                        const std::vector<std::vector<double>>& z, int n_rows, int judge_steps, RngKey key);

/// Area under the ROC curve: the chance that a draw from `positive` exceeds one from `negative`, ties counting half.
/// Both non-empty.
double AreaUnderCurve(const std::vector<double>& positive, const std::vector<double>& negative);

/// All samples of a batch of z, one after the other.
Array2<double> Pool(const std::vector<LaneExperience>& experience);

}  // namespace oted
