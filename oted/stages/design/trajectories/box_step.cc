#include "oted/stages/design/trajectories/box_step.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace oted {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd StepWithin(const MatrixXd& hessian, const VectorXd& gradient, const VectorXd& low, const VectorXd& high) {
  VectorXd step = VectorXd::Zero(gradient.size());
  std::vector<Index> free(static_cast<size_t>(gradient.size()));
  std::iota(free.begin(), free.end(), Index{0});
  while (!free.empty()) {
    step(free).setZero();
    const VectorXd left = gradient - hessian * step;  // by those at their walls
    const VectorXd wanted = hessian(free, free).ldlt().solve(left(free));
    if (!wanted.allFinite()) return VectorXd::Zero(gradient.size());
    step(free) = wanted.cwiseMax(low(free)).cwiseMin(high(free));
    Index farthest = 0;
    if (!((wanted - step(free)).cwiseAbs().maxCoeff(&farthest) > 0)) break;
    free.erase(free.begin() + farthest);
  }
  return step;
}

}  // namespace oted
