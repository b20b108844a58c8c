#pragma once
/// Windows of tenths of a second to a second, for logs that the simulators of the family do not explain down to the
/// sensors' noise: recordings of real robots. There short windows tell of little but noise and of how velocities were
/// differentiated, and what matters is prediction.

#include <Eigen/Dense>
#include <functional>
#include <vector>

#include "oted/base/log.h"
#include "oted/base/rng.h"
#include "oted/matching/fit_evidence.h"
#include "oted/matching/held_out.h"
#include "oted/matching/prior.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/replay/prediction.h"
#include "oted/stages/design/trajectories/level_fit.h"

namespace oted {

inline constexpr double kShortestLongWindow = 0.1;  ///< [s]

/// Windows of `n_steps` in all of the logs, at most some `n_rows` rows of them, spread evenly. Windows that begin
/// within the same second of an episode are one stretch: what a simulator has wrong there is wrong in all of them.
Level LongWindows(WindowReplayer& replayer, const Dataset& dataset, int n_steps, int n_rows, double period_s);

/// Windows of `shortest` steps that FitGrowing can join up to `n_steps`: those of LongWindows, cut into pieces. Short
/// ones that were spread over long logs would have no neighbours to be joined with.
Level GrowingWindows(WindowReplayer& replayer, const Dataset& dataset, int shortest, int n_steps, int n_rows,
                     double period_s);

/// How many rows of such windows to linearize: `wanted`, or as many as `n_steps` of the physics afford. What a model
/// takes for a step counts, not the clock: the same logs give the same rows on any machine.
int AffordableRows(int wanted, double n_steps, const SimulatorFactory& factory, const ReadingModel& readings);

/// A fit of long windows, chosen among lengths by prediction of recordings that it leaves out.
struct LongFitChoice {
  int n_steps = 0;    ///< of the windows; 0: no length predicts better than the short windows' parameters
  Eigen::VectorXd x;  ///< fitted to `learn`
  /// x of every fit that was tried and does not surely predict worse, this one's too.
  std::vector<Eigen::VectorXd> as_good = {};
  LeftOutInTurn left_out = {};  ///< how it predicts them; empty where n_steps is 0
};

struct LongFitInputs {
  const SimulatorFactory& factory;
  const HeldOutParts& parts;  ///< whose part that learns is fitted
  const Prior& prior;
  const ReadingModel& readings;
  Eigen::VectorXd short_x;  ///< what short windows gave
  Eigen::VectorXd noise;    ///< (obs_dim): standard deviations, what short windows left
  int short_steps = 0;      ///< length of the short windows
  /// Whether the simulator explains the short windows at every length. Then only what is surely better takes their
  /// place, otherwise what is not surely worse.
  bool explained = true;
};

/// Whether parameters of long windows take the place of those of short windows, by their errors: (channels, windows),
/// mean squares of predictions. Where the family explains the short windows (`explained`), the long ones' have to be
/// surely better by a hundredth of the error, as there is no reason but chance; elsewhere they have to be not surely
/// worse, as short windows tell of noise. What predicts worse than the nominal simulator explains nothing, however
/// little the short windows leave.
/// @param of_nominal  asked only where it matters
bool TakesOver(const Eigen::MatrixXd& of_long, const Eigen::MatrixXd& of_short,
               const std::function<Eigen::MatrixXd()>& of_nominal, bool explained);

/// Steps of ChooseLongWindows, at most.
inline constexpr int kMostLongTries = 84;

/// Fits windows of 0.1 s to 1 s to `learn`, from the nominal parameters and from those of the short windows, and
/// compares how well recordings that they leave out are predicted over half a second (less where episodes are shorter).
/// Of the lengths that no other surely beats, the one nearest to that horizon is taken: a fit is best at what it was
/// asked. The logs that are kept aside have no part in it.
/// @param tell  called with x after every step
LongFitChoice ChooseLongWindows(const LongFitInputs& inputs, const RunContext& context,
                                const std::function<void(const Eigen::VectorXd&)>& tell);

}  // namespace oted
