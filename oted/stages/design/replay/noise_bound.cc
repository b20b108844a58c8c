#include "oted/stages/design/replay/noise_bound.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "oted/base/statistics.h"
#include "oted/stages/design/replay/reading_model.h"

namespace oted {
namespace {

/// What gives the value of a polynomial in the middle of the readings around: a cubic's, and of two orders more each.
struct Around {
  std::vector<double> weights;  ///< of the nearest two, the next two, ...
  double divisor;
};
const std::array<Around, 3> kPolynomials = {{{{4, -1}, 6}, {{15, -6, 1}, 20}, {{56, -28, 8, -1}, 70}}};

constexpr double kSteep = 0.2;  // what a higher order has to leave of a lower one's
constexpr double kSlack = 1.25;
constexpr double kMedianOfNormal = 0.67449;  // of its absolute value

/// The median distance of a reading from the polynomial through those around, as the standard deviation of the noise
/// that leaves it. Infinite where no episode has enough.
double NoiseByPolynomial(const Dataset& logs, int channel, const Around& polynomial) {
  const auto n_around = static_cast<int>(polynomial.weights.size());
  const auto at = [&](int row) { return logs.observations(row, channel); };
  std::vector<double> apart;
  for (const Episode& episode : logs.Episodes()) {
    for (int row = episode.begin + n_around; row + n_around < episode.end; ++row) {
      double sum = 0;
      for (int k = 1; k <= n_around; ++k)
        sum += polynomial.weights[static_cast<size_t>(k - 1)] * (at(row - k) + at(row + k));
      apart.push_back(std::abs(at(row) - sum / polynomial.divisor));
    }
  }
  if (apart.empty()) return std::numeric_limits<double>::infinity();
  // Of the difference of a reading and that value, where all have noise of 1.
  double grown = 1;
  for (const double weight : polynomial.weights) grown += 2 * std::pow(weight / polynomial.divisor, 2);
  return Median(std::move(apart)) / (kMedianOfNormal * std::sqrt(grown));
}

/// A higher order counts where it leaves far less: there is motion that the lower one does not follow, not noise.
double NoiseOf(const Dataset& logs, int channel) {
  double noise = NoiseByPolynomial(logs, channel, kPolynomials.front());
  for (size_t k = 1; k < kPolynomials.size(); ++k) {
    const double of_higher = NoiseByPolynomial(logs, channel, kPolynomials[k]);
    if (!(of_higher < kSteep * noise)) break;
    noise = of_higher;
  }
  return noise;
}

}  // namespace

Eigen::VectorXd LargestNoise(const Dataset& logs) {
  const Eigen::VectorXd of_steps = QuantisationNoise(logs);
  Eigen::VectorXd largest(logs.obs_dim());
  for (int c = 0; c < logs.obs_dim(); ++c) largest[c] = std::max(kSlack * NoiseOf(logs, c), of_steps[c]);
  return largest;
}

}  // namespace oted
