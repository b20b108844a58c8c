#pragma once
/// From what single stretches of a log say of the parameters: the estimate, and how far it can be off.

#include <Eigen/Dense>
#include <vector>

#include "oted/matching/prior.h"

namespace oted {

/// One stretch's log likelihood of x, to second order about the present x, its own start states eliminated.
struct StretchEvidence {
  Eigen::MatrixXd information;  ///< (d, d), positive semidefinite
  Eigen::VectorXd score;        ///< (d): the gradient
  int row = 0;                  ///< of the log, where it begins
};

struct StretchEstimate {
  Eigen::VectorXd step;  ///< from the present x to the estimate
  Eigen::MatrixXd covariance;
  Eigen::MatrixXd inverse_information;  ///< H^-1: the covariance, were noise the only thing that the simulator lacks
};

/// One undamped Newton step over all stretches and the prior, and its covariance. Two things are not
/// taken on trust, since derivatives through contact are what two replays happened to show and noise is no Gaussian:
///
/// No stretch decides more than six times its part of any direction of x, and none more than a quarter; more than six
/// times where so few tell of it that the prior would take their place. One whose derivatives crossed a contact can
/// otherwise outweigh all others with a number that means nothing. Its weight depends on its information alone, and not
/// on what it says, so that the estimate stays unbiased.
///
/// The covariance is H^-1, the inverse of the information that was counted, but wider in every direction in which the
/// estimates without one stretch (a delete-one jackknife) scatter more than that. It is never narrower: where few
/// stretches tell a parameter, their scatter says little.
StretchEstimate EstimateFromStretches(const std::vector<StretchEvidence>& stretches, const Eigen::VectorXd& x,
                                      const Prior& prior);

/// The same for a first look, which nothing rests on: where there are fewer than eight stretches, each may decide twice
/// its part. With a quarter at most, two of them leave half to the prior, and ask for nothing.
StretchEstimate GuessFromStretches(const std::vector<StretchEvidence>& stretches, const Eigen::VectorXd& x,
                                   const Prior& prior);

/// The same where the family does not explain the logs. What fits best then differs from one part of a log to the next,
/// and from this log to another, so more rows make the estimate no surer. The covariance is how far the estimates from
/// single eighths of the log scatter, and at least H^-1: what another log may ask for.
StretchEstimate EstimateFromParts(const std::vector<StretchEvidence>& stretches, const Eigen::VectorXd& x,
                                  const Prior& prior);

}  // namespace oted
