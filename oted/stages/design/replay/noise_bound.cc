#include "oted/stages/design/replay/noise_bound.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "oted/stages/design/replay/reading_model.h"

namespace oted {
namespace {

constexpr int kAround = 2;                // readings on either side
constexpr double kNear = 4.0, kFar = -1;  // sixths of them, which give a cubic's value in the middle
constexpr double kSlack = 1.25;
constexpr double kMedianOfNormal = 0.67449;  // of its absolute value

}  // namespace

Eigen::VectorXd LargestNoise(const Dataset& logs) {
  // Of the difference of a reading and that value, where all have noise of 1.
  const double grown = std::sqrt(1 + 2 * (kNear * kNear + kFar * kFar) / 36);
  const Eigen::VectorXd of_steps = QuantisationNoise(logs);
  Eigen::VectorXd largest(logs.obs_dim());
  for (int c = 0; c < logs.obs_dim(); ++c) {
    const auto at = [&](int row) { return logs.observations(row, c); };
    std::vector<double> apart;
    for (const Episode& episode : logs.Episodes()) {
      for (int row = episode.begin + kAround; row + kAround < episode.end; ++row) {
        const double around = (kNear * (at(row - 1) + at(row + 1)) + kFar * (at(row - 2) + at(row + 2))) / 6;
        apart.push_back(std::abs(at(row) - around));
      }
    }
    largest[c] = std::numeric_limits<double>::infinity();
    if (apart.empty()) continue;
    const auto middle = apart.begin() + static_cast<std::ptrdiff_t>(apart.size() / 2);
    std::ranges::nth_element(apart, middle);
    largest[c] = std::max(kSlack * *middle / (kMedianOfNormal * grown), of_steps[c]);
  }
  return largest;
}

}  // namespace oted
