#include "oted/stages/design/trajectories/stretch_estimate.h"

#include <algorithm>

namespace oted {
namespace {

using Eigen::LLT;
using Eigen::MatrixXd;
using Eigen::SelfAdjointEigenSolver;
using Eigen::VectorXd;

constexpr double kTimesTheMean = 6;     // a stretch's share of the information on any direction
constexpr double kLargestShare = 0.25;  // at most
constexpr double kPriorsShare = 0.1;    // where it is more, too few stretches tell of a direction for such a share
constexpr int kShareRounds = 50;        // the shares settle in a few

/// L^-1 m L^-T.
MatrixXd Whitened(const LLT<MatrixXd>& factor, const MatrixXd& m) {
  const MatrixXd half = factor.matrixL().solve(m);
  return factor.matrixL().solve(half.transpose());
}

double LargestEigenvalue(const MatrixXd& m) {
  return SelfAdjointEigenSolver<MatrixXd>(m, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff();
}

MatrixXd Hessian(const std::vector<StretchEvidence>& stretches, const std::vector<double>& weights,
                 const MatrixXd& prior) {
  MatrixXd hessian = prior;
  for (size_t k = 0; k < stretches.size(); ++k) hessian += weights[k] * stretches[k].information;
  return hessian;
}

/// What each stretch counts, at most 1, so that none has more than `largest` of any direction.
std::vector<double> Weights(const std::vector<StretchEvidence>& stretches, const MatrixXd& prior,
                            double largest_share) {
  std::vector<double> weights(stretches.size(), 1.0);
  for (int round = 0; round < kShareRounds; ++round) {
    const LLT<MatrixXd> factor(Hessian(stretches, weights, prior));
    bool settled = true;
    for (size_t k = 0; k < stretches.size(); ++k) {
      const double share = LargestEigenvalue(Whitened(factor, weights[k] * stretches[k].information));
      if (share <= largest_share * 1.01) continue;
      weights[k] *= largest_share / share;
      settled = false;
    }
    if (settled) break;
  }
  return weights;
}

/// The smallest share that leaves every direction to the logs: what few stretches show, these may decide.
std::vector<double> Weights(const std::vector<StretchEvidence>& stretches, const MatrixXd& prior) {
  for (double share = kTimesTheMean / static_cast<double>(stretches.size());; share *= 2) {
    const std::vector<double> weights = Weights(stretches, prior, std::min(share, kLargestShare));
    const LLT<MatrixXd> factor(Hessian(stretches, weights, prior));
    if (share >= kLargestShare || LargestEigenvalue(Whitened(factor, prior)) < kPriorsShare) return weights;
  }
}

}  // namespace

StretchEstimate EstimateFromStretches(const std::vector<StretchEvidence>& stretches, const VectorXd& x,
                                      const Prior& prior) {
  const std::vector<double> weights = Weights(stretches, prior.precision);
  const MatrixXd hessian = Hessian(stretches, weights, prior.precision);
  VectorXd score = -prior.precision * (x - prior.mean);
  for (size_t k = 0; k < stretches.size(); ++k) score += weights[k] * stretches[k].score;
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
