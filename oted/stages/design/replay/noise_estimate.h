#pragma once
/// How noisy a log is, told from windows that were fitted with unknown start states.

#include <Eigen/Dense>
#include <vector>

#include "oted/data/dataset.h"
#include "oted/sim/simulator.h"
#include "oted/stages/design/replay/reading_model.h"

namespace oted {

inline constexpr double kNoiseGuess = 0.01;  ///< of a channel's standard deviation, where nothing is known yet

/// What one window tells, as WindowReplayer has it.
struct FittedWindow {
  Eigen::VectorXd residual;  ///< (n), logged minus simulated; empty where there is none
  Eigen::MatrixXd d_start;   ///< (n, state_dim): of the simulated numbers, by the start that was fitted
};

/// The variance of every channel's noise.
///
/// A start state that was fitted to noisy readings follows them: it takes freedom from the residuals, most from the
/// channels that are trusted most. Residual i of a window keeps 1 - h_i of its variance, where h_i is the leverage of
/// reading i in the weighted fit of the start; without that correction (restricted maximum likelihood makes the same)
/// one channel's noise can shrink to nothing while the others' grows. The estimate is the median of r_i^2 / (1 - h_i),
/// each counting 1 - h_i, over that of a squared standard normal: windows through contact, whose starts may be caught
/// in a local minimum, would govern a mean. Residuals that are rounding say nothing of noise and are left out. Readings
/// that are not held because they were computed from others tell of their noise all the same; those that are too old
/// tell nothing. No estimate is below what a reading's own steps make.
///
/// @param guess     (n_channels): variances by which the starts were weighed; leverages follow from it, and are made
///                  again from what it gives, twice
/// @param smallest  (n_channels): variance of rounding; the least that is returned
Eigen::VectorXd NoiseVariance(const ReadingModel& readings, const std::vector<FittedWindow>& windows,
                              const Eigen::VectorXd& guess, const Eigen::VectorXd& smallest);

/// How many neighbouring readings of a window err as one: the integrated autocorrelation time of what is left, up to
/// the first lag that hardly correlates, its mean over the channels. 1 for independent noise; as many as a window has
/// where what a simulator lacks drives it off.
/// @param weight  (n): of the squares, so that every reading's is of the same size; 0 of those that are not held
double CorrelationTime(const std::vector<FittedWindow>& windows, const Eigen::VectorXd& weight,
                       Eigen::Index n_channels);

/// (obs_dim): the standard deviation of every channel's noise, as the simulator at z has it: what it leaves of the
/// shortest windows, spread over the logs.
Eigen::VectorXd SensorNoise(const SimulatorFactory& factory, const Dataset& logs, const ReadingModel& readings,
                            const std::vector<double>& z, int n_threads);

}  // namespace oted
