#pragma once
/// How noisy a log is, told from windows that were fitted with unknown start states.

#include <Eigen/Dense>
#include <vector>

namespace oted {

/// What one window tells: residuals of `n_observations` consecutive observations, each of `n_channels` numbers.
struct FittedWindow {
  Eigen::VectorXd residual;  ///< (n_observations n_channels), logged minus simulated; empty where there is none
  Eigen::MatrixXd d_start;   ///< (the same, n_channels): of the simulated numbers, by the start that was fitted
};

/// The variance of every channel's noise.
///
/// A start state that was fitted to noisy readings follows them: it takes freedom from the residuals, most from the
/// channels that are trusted most. Residual i of a window keeps 1 - h_i of its variance, where h_i is the leverage of
/// reading i in the weighted fit of the start; without that correction (restricted maximum likelihood makes the same)
/// one channel's noise can shrink to nothing while the others' grows. The estimate is the median of r_i^2 / (1 - h_i),
/// each counting 1 - h_i, over that of a squared standard normal: windows through contact, whose starts may be caught
/// in a local minimum, would govern a mean. Residuals that are rounding say nothing of noise and are left out.
///
/// @param guess     (n_channels): variances by which the starts were weighed; leverages follow from it, and are made
///                  again from what it gives, twice
/// @param smallest  (n_channels): variance of rounding; the least that is returned
Eigen::VectorXd NoiseVariance(const std::vector<FittedWindow>& windows, const Eigen::VectorXd& guess,
                              const Eigen::VectorXd& smallest);

}  // namespace oted
