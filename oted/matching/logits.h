#pragma once
/// The search coordinates of q: x in R^d; u = 1 / (1 + exp(-x)) lies in the unit cube, ParameterSpace maps it into the
/// bounds.

#include <span>
#include <vector>

#include "oted/sim/parameter_space.h"

namespace oted {

/// Beyond this |x| (0.25 % of the range) ZToLogit stops: a value on its bound has no finite logit.
inline constexpr double kLargestLogit = 6.0;

double LogitToUnit(double x);
std::vector<double> LogitToZ(const ParameterSpace& space, std::span<const double> x);
std::vector<double> ZToLogit(const ParameterSpace& space, std::span<const double> z);

/// One draw of q: x, and z = z(x).
struct SearchSample {
  std::vector<double> x;
  std::vector<double> z;
};

/// Of z.
struct SearchInterval {
  double low, high;
};

/// Weights and steps of one ascent on E_q[R] - lambda KL(q, p) (Eq. 3).
struct AscentSteps {
  double lambda = 0;
  double mean = 0;     ///< on the mean of a Gaussian, or on the logits of probabilities
  double log_std = 0;  ///< on the log spread of a Gaussian
};

}  // namespace oted
