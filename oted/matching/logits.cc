#include "oted/matching/logits.h"

#include <algorithm>
#include <cmath>

namespace oted {

double LogitToUnit(double x) { return 1.0 / (1.0 + std::exp(-x)); }

std::vector<double> LogitToZ(const ParameterSpace& space, std::span<const double> x) {
  std::vector<double> u(x.size());
  std::transform(x.begin(), x.end(), u.begin(), LogitToUnit);
  return space.FromUnit(u);
}

std::vector<double> ZToLogit(const ParameterSpace& space, std::span<const double> z) {
  std::vector<double> x = space.ToUnit(z);
  for (double& value : x) value = std::clamp(std::log(value / (1.0 - value)), -kLargestLogit, kLargestLogit);
  return x;
}

}  // namespace oted
