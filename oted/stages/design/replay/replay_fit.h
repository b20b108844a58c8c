#pragma once
/// What the designs have in common that replay windows of the log and need no discriminator to find q: trajectory
/// matching, least squares and DROPO. Each lays a Gaussian over the search coordinates x (logits of the range,
/// oted/matching/designer.h).

#include <Eigen/Dense>
#include <functional>
#include <optional>
#include <vector>

#include "oted/base/log.h"
#include "oted/data/dataset.h"
#include "oted/matching/fit_evidence.h"
#include "oted/matching/prior.h"
#include "oted/stages/design/replay/windows.h"

namespace oted {

/// q as a Gaussian over x.
struct ReplayFit {
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  std::optional<FitEvidence> evidence;  ///< of methods that estimate the logs' noise
};

/// Called after each step of a fit: how many were made, of how many at most, and the present x.
using FitProgress = std::function<void(int done, int total, const Eigen::VectorXd& x)>;

/// What such a design is given. What it refers to must outlive it.
struct ReplayProblem {
  const SimulatorFactory& factory;
  const Dataset& dataset;
  const Prior& prior;
  RngKey key;
  const FitProgress& progress;
  const RunContext& context;
  bool judged = true;             ///< as DesignProblem::judged
  RngKey kept_aside = RngKey(0);  ///< of KeepAside
};

inline constexpr double kMaxX = 6.0;            ///< |x| at most this, as the designer's: a 400th of the range
inline constexpr double kSmallestNoise = 3e-8;  ///< of a channel, over its scale: the rounding of logs in float32

/// z at x.
std::vector<double> ToZ(const ParameterSpace& space, const Eigen::VectorXd& x);
/// The nominal parameters as x, no nearer to a bound than |x| = 3: a start on a bound would hardly move.
Eigen::VectorXd NominalStart(const ParameterSpace& space);
/// What fits to trajectories take for `prior`: one that is uniform they move about the nominal parameters (|x| at most
/// 2), as wide as it is. So what the logs do not show stays at its nominal value.
Prior ForTrajectories(const Prior& prior, const ParameterSpace& space);
/// (obs_dim): the standard deviation of every channel over the logs, as the normaliser has it (oted/data/normalizer.h).
Eigen::VectorXd ChannelScales(const Dataset& dataset);

/// A replayer on so many threads. What it is given must outlive it.
WindowReplayer MakeReplayer(const SimulatorFactory& factory, const Dataset& dataset, const ReadingModel& readings,
                            int n_threads);

/// How readings were held by the fit that left `unseen`; none, and as the logs alone say.
ReadingModel ReadingsOf(const SimulatorSpec& spec, const Dataset& logs, const std::optional<UnseenFit>& unseen);

/// Stretches of the log of `length` rows, each within an episode, in random order until they hold `n_rows` rows.
std::vector<LogWindow> DrawStretches(const Dataset& dataset, int length, int n_rows, Rng& rng);
/// The same without those to whose first logged state the simulator cannot be set. @throws DataError when none is left
std::vector<LogWindow> DrawStartable(WindowReplayer& replayer, const Dataset& dataset, const SimulatorSpec& spec,
                                     int length, int n_rows, Rng& rng);
/// The first states of windows, as far as they were logged (WindowReplayer::Guess).
std::vector<Eigen::VectorXd> LoggedStarts(const WindowReplayer& replayer, const std::vector<LogWindow>& windows);

/// A design that sets states has no state to set. @throws DataError, always
[[noreturn]] void ThrowNothingStartable(const Dataset& dataset, const SimulatorSpec& spec, int length);

}  // namespace oted
