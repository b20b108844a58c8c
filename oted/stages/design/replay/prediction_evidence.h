#pragma once
/// The evidence that verdicts rest on: how a designed simulator predicts logs beside the nominal one, and beside what
/// the sensors' noise would leave if it were right.

#include <Eigen/Dense>
#include <functional>
#include <optional>
#include <vector>

#include "oted/base/rng.h"
#include "oted/data/dataset.h"
#include "oted/matching/held_out_prediction.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/replay/reading_model.h"

namespace oted {

/// What is predicted, and by which simulator. What it refers to must outlive the call.
struct PredictionProblem {
  const SimulatorFactory& factory;  ///< whose state can be set
  const Dataset& kept_aside;        ///< logs that the design did not learn from,
  const Dataset* learned;           ///< and those that it did: they count where the floor is compared. May be null
  const std::vector<double>& z;     ///< the design's
  const Eigen::VectorXd& noise;     ///< (obs_dim): standard deviations of the sensors, roughly
  const ReadingModel& readings;     ///< how starts are told by them
  std::vector<int> narrow;          ///< parameters whose intervals have to be borne out (HeldOutPrediction::OpenEnd)
  RngKey key;
  int n_threads = 1;
  int noise_rows = 0;                ///< of the logs, that tell `noise`; 0: it is certain
  bool noise_of_other_logs = false;  ///< `noise` is: these may be of any other noise, and their leads tell it
  /// Other z that are as likely as `z`: the noise alone may have put it there. None, and z is taken for certain.
  std::vector<std::vector<double>> as_likely = {};
  /// Of each row kept aside, and of each that was learned from, the episode of all logs that it is in; empty: of these.
  std::vector<int> kept_aside_in = {}, learned_in = {};
  int n_whole = 0;  ///< of the episodes kept aside, the first ones: recordings of which nothing was learned
  std::function<void(int done, int total)> tell = {};  ///< how far the predictions are; may stop them by an exception

  /// Whether nothing was kept aside: the logs that judge are those that it learned from.
  bool JudgesByLearned() const { return learned == nullptr && n_whole == 0; }
};

/// Predictions over 0.1, 0.5 and 1 s (2, 10 and 20 control steps where time has no unit), as far as episodes last that
/// long: at a horizon for which those kept aside are too short, the learned ones judge. None where nothing can be
/// predicted.
///
/// The floor is a parametric bootstrap of the judge itself. The designed simulator makes logs of its own on the same
/// windows, from where it follows them best, and predicts these in the same way: from starts that are fitted to noisy
/// readings, through contacts that magnify what is unknown of them. Its sensors' noise is first scaled, channel by
/// channel, until starts fitted to readings leave as much as in the logs (the median over windows), so that neither a
/// guess that is too high nor noise that is no Gaussian passes for an error of the simulator. A design that is wrong
/// leaves more in those starts than noise does, and may not even predict its own logs. So the noise is at most what the
/// readings alone allow (LargestNoise). And where the nominal simulator predicts no worse, and its own logs surely
/// better, the floor is that of the nominal one.
///
/// Readings that show the whole state without noise have the floor 0. Where starts have to be found (positions alone),
/// finding them in the design's own logs is part of the floor, however exact the sensors are.
///
/// Noisy logs leave the parameters uncertain as well. Logs that the designed simulator made are predicted by one that
/// is off by as much: at one of `as_likely`.
///
/// Standard errors: delete-one jackknife over ten blocks of neighbouring windows; that of the excess is at least how
/// far predictions of the logs that were made scatter among each other. Few rows tell the noise, and with it the floor,
/// only roughly: that of the excess has the noise's own in it.
std::optional<HeldOutPrediction> PredictLogs(const PredictionProblem& problem);

/// How the simulator predicts at problem.z beside the same one at `other`, which takes the nominal one's place. No
/// floor is looked for, which takes most of the time: it and the excess are 0.
std::optional<HeldOutPrediction> PredictBeside(const PredictionProblem& problem, const std::vector<double>& other);

}  // namespace oted
