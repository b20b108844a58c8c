#include "oted/stages/design/trajectories/stretch_estimate.h"

#include <algorithm>
#include <utility>

namespace oted {
namespace {

using Eigen::LLT;
using Eigen::MatrixXd;
using Eigen::SelfAdjointEigenSolver;
using Eigen::VectorXd;

constexpr double kTimesTheMean = 6;     // a stretch's share of the information on any direction
constexpr double kLargestShare = 0.25;  // at most
constexpr double kTimesFair = 2;        // of its part, where there are too few for that
constexpr double kPriorsShare = 0.1;    // where it is more, too few stretches tell of a direction for such a share
constexpr int kShareRounds = 50;        // the shares settle in a few
constexpr size_t kParts = 8;            // of a log that the family does not explain

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
std::vector<double> WeightsUpTo(double largest, const std::vector<StretchEvidence>& stretches, const MatrixXd& prior) {
  for (double share = kTimesTheMean / static_cast<double>(stretches.size());; share *= 2) {
    const std::vector<double> weights = Weights(stretches, prior, std::min(share, largest));
    const LLT<MatrixXd> factor(Hessian(stretches, weights, prior));
    if (share >= largest || LargestEigenvalue(Whitened(factor, prior)) < kPriorsShare) return weights;
  }
}

/// What the stretches say together, each counted by its weight.
class WeightedStretches {
 public:
  WeightedStretches(std::vector<StretchEvidence> stretches, const VectorXd& x, const Prior& prior,
                    double largest_share = kLargestShare)
      : stretches_(std::move(stretches)) {
    const std::vector<double> weights = WeightsUpTo(largest_share, stretches_, prior.precision);
    hessian_ = Hessian(stretches_, weights, prior.precision);
    VectorXd score = -prior.precision * (x - prior.mean);
    for (size_t k = 0; k < stretches_.size(); ++k) {
      stretches_[k].information *= weights[k];
      stretches_[k].score *= weights[k];
      score += stretches_[k].score;
    }
    factor_.compute(hessian_);
    step_ = factor_.solve(score);
  }

  /// Joins neighbours until at most n are left.
  void JoinTo(size_t n) {
    std::ranges::stable_sort(stretches_, {}, &StretchEvidence::row);
    std::vector<StretchEvidence> joined;
    n = std::min(n, stretches_.size());
    for (size_t k = 0; k < stretches_.size(); ++k) {
      if (joined.size() * stretches_.size() <= k * n) {
        joined.push_back(stretches_[k]);
      } else {
        joined.back().information += stretches_[k].information;
        joined.back().score += stretches_[k].score;
      }
    }
    stretches_ = std::move(joined);
  }

  /// (d, d): squares of how far the estimate moves without one of the stretches, summed, in units of H^-1.
  MatrixXd Jackknife() const {
    MatrixXd scatter = MatrixXd::Zero(step_.size(), step_.size());
    for (const StretchEvidence& stretch : stretches_) {
      const VectorXd left = stretch.score - stretch.information * step_;
      const MatrixXd without = hessian_ - stretch.information;
      const VectorXd moved = factor_.matrixL().transpose() * without.ldlt().solve(left);
      scatter += moved * moved.transpose();
    }
    return scatter;
  }

  size_t size() const { return stretches_.size(); }

  /// @param scatter  as Jackknife's
  StretchEstimate Estimate(const MatrixXd& scatter) const {
    const MatrixXd none = MatrixXd::Zero(step_.size(), step_.size());
    return {.step = step_, .covariance = Covariance(scatter), .inverse_information = Covariance(none)};
  }

 private:
  /// H^-1, wider in every direction in which `scatter` is.
  MatrixXd Covariance(const MatrixXd& scatter) const {
    const SelfAdjointEigenSolver<MatrixXd> wider(scatter);
    const MatrixXd at_least_one =
        wider.eigenvectors() * wider.eigenvalues().cwiseMax(1.0).asDiagonal() * wider.eigenvectors().transpose();
    const MatrixXd inverse_factor = factor_.matrixL().solve(MatrixXd::Identity(step_.size(), step_.size()));
    const MatrixXd covariance = inverse_factor.transpose() * at_least_one * inverse_factor;
    return 0.5 * (covariance + covariance.transpose());
  }

  std::vector<StretchEvidence> stretches_;  // weighted
  MatrixXd hessian_;
  LLT<MatrixXd> factor_;
  VectorXd step_;
};

}  // namespace

StretchEstimate EstimateFromStretches(const std::vector<StretchEvidence>& stretches, const VectorXd& x,
                                      const Prior& prior) {
  const WeightedStretches weighted(stretches, x, prior);
  return weighted.Estimate(weighted.Jackknife());
}

StretchEstimate GuessFromStretches(const std::vector<StretchEvidence>& stretches, const VectorXd& x,
                                   const Prior& prior) {
  const double fair = 1.0 / static_cast<double>(std::max<size_t>(1, stretches.size()));
  const WeightedStretches weighted(stretches, x, prior, std::max(kLargestShare, kTimesFair * fair));
  return weighted.Estimate(weighted.Jackknife());
}

StretchEstimate EstimateFromParts(const std::vector<StretchEvidence>& stretches, const VectorXd& x,
                                  const Prior& prior) {
  WeightedStretches weighted(stretches, x, prior);
  weighted.JoinTo(kParts);
  // A jackknife over n parts scatters as their mean does; one of them scatters n times as much.
  return weighted.Estimate(static_cast<double>(weighted.size()) * weighted.Jackknife());
}

}  // namespace oted
