#include "oted/stages/design/trajectories/stretch_estimate.h"

#include <algorithm>

namespace oted {
namespace {

using Eigen::LLT;
using Eigen::MatrixXd;
using Eigen::SelfAdjointEigenSolver;
using Eigen::VectorXd;

constexpr double kLargestShare = 0.25;  // of the information on any direction, from one stretch
constexpr int kShareRounds = 50;        // the shares settle in a few

/// L^-1 m L^-T.
MatrixXd Whitened(const LLT<MatrixXd>& factor, const MatrixXd& m) {
  const MatrixXd half = factor.matrixL().solve(m);
  return factor.matrixL().solve(half.transpose());
}

/// What each stretch counts, at most 1.
std::vector<double> Weights(const std::vector<StretchEvidence>& stretches, const MatrixXd& prior) {
  std::vector<double> weights(stretches.size(), 1.0);
  for (int round = 0; round < kShareRounds; ++round) {
    MatrixXd hessian = prior;
    for (size_t k = 0; k < stretches.size(); ++k) hessian += weights[k] * stretches[k].information;
    const LLT<MatrixXd> factor(hessian);
    bool settled = true;
    for (size_t k = 0; k < stretches.size(); ++k) {
      const SelfAdjointEigenSolver<MatrixXd> share(Whitened(factor, weights[k] * stretches[k].information),
                                                   Eigen::EigenvaluesOnly);
      const double largest = share.eigenvalues().maxCoeff();
      if (largest <= kLargestShare * 1.01) continue;
      weights[k] *= kLargestShare / largest;
      settled = false;
    }
    if (settled) break;
  }
  return weights;
}

}  // namespace

StretchEstimate EstimateFromStretches(const std::vector<StretchEvidence>& stretches, const VectorXd& x,
                                      const Prior& prior) {
  const std::vector<double> weights = Weights(stretches, prior.precision);
  MatrixXd hessian = prior.precision;
  VectorXd score = -prior.precision * (x - prior.mean);
  for (size_t k = 0; k < stretches.size(); ++k) {
    hessian += weights[k] * stretches[k].information;
    score += weights[k] * stretches[k].score;
  }
  const LLT<MatrixXd> factor(hessian);
  StretchEstimate estimate;
  estimate.step = factor.solve(score);

  // How far the estimate moves without one of the stretches.
  MatrixXd scatter = MatrixXd::Zero(x.size(), x.size());
  for (size_t k = 0; k < stretches.size(); ++k) {
    const VectorXd left = weights[k] * (stretches[k].score - stretches[k].information * estimate.step);
    const MatrixXd without = hessian - weights[k] * stretches[k].information;
    const VectorXd moved = factor.matrixL().transpose() * without.ldlt().solve(left);
    scatter += moved * moved.transpose();
  }
  SelfAdjointEigenSolver<MatrixXd> wider(scatter);
  const MatrixXd at_least_one =
      wider.eigenvectors() * wider.eigenvalues().cwiseMax(1.0).asDiagonal() * wider.eigenvectors().transpose();
  const MatrixXd inverse_factor = factor.matrixL().solve(MatrixXd::Identity(x.size(), x.size()));
  estimate.covariance = inverse_factor.transpose() * at_least_one * inverse_factor;
  estimate.covariance = (0.5 * (estimate.covariance + estimate.covariance.transpose())).eval();
  return estimate;
}

}  // namespace oted
