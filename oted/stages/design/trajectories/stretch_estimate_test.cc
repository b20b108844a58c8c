#include "oted/stages/design/trajectories/stretch_estimate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oted/base/rng.h"

namespace oted::stretch_estimate_test {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kPriorStd = 1.7;
constexpr int kReadings = 6;  // of one stretch

/// Stretches of linear readings y = J x + noise of standard deviation 1, believed to be such, at x = `at`.
/// @param spread  the noise's real standard deviation
std::vector<StretchEvidence> Linear(const VectorXd& truth, const VectorXd& at, int n, double spread, Rng& rng) {
  std::vector<StretchEvidence> stretches;
  for (int k = 0; k < n; ++k) {
    MatrixXd jacobian(kReadings, truth.size());
    VectorXd residual(kReadings);
    for (double& entry : jacobian.reshaped()) entry = rng.Normal();
    for (double& entry : residual) entry = spread * rng.Normal();
    residual += jacobian * (truth - at);
    stretches.push_back({jacobian.transpose() * jacobian, jacobian.transpose() * residual});
  }
  return stretches;
}

VectorXd Pair(double a, double b) { return (VectorXd(2) << a, b).finished(); }

TEST(EstimateFromStretches, OfALinearPlantIsThePosteriorMeanFromWhereverItStarts) {
  Rng rng(1);
  const VectorXd truth = Pair(0.3, -0.7), at = Pair(1, 1);
  const auto stretches = Linear(truth, at, 40, 1, rng);
  MatrixXd precision = MatrixXd::Identity(2, 2) / (kPriorStd * kPriorStd);
  VectorXd seen = VectorXd::Zero(2);
  for (const StretchEvidence& s : stretches) {
    precision += s.information;
    seen += s.score + s.information * at;
  }
  const StretchEstimate estimate = EstimateFromStretches(stretches, at, Prior::Uniform(2));
  EXPECT_LT((at + estimate.step - precision.ldlt().solve(seen)).norm(), 1e-12);
  // The jackknife's scatter may widen it by its own chance, and nothing may make it narrower.
  const MatrixXd exact = precision.inverse();
  for (int i = 0; i < 2; ++i) {
    EXPECT_GE(estimate.covariance(i, i), exact(i, i) * (1 - 1e-12));
    EXPECT_LE(estimate.covariance(i, i), exact(i, i) * 2);
  }
}

/// How many of `n_cases` 90 % intervals hold the truth, of two parameters.
int Held(int n_cases, int n_stretches, double spread, double spoiled_information, int n_spoiled = 1) {
  int held = 0;
  for (int k = 0; k < n_cases; ++k) {
    Rng rng = RngKey(2).Index(static_cast<uint64_t>(k)).MakeRng();
    const VectorXd truth = Pair(rng.Uniform(-1, 1), rng.Uniform(-1, 1)), at = truth + Pair(0.1, -0.1);
    auto stretches = Linear(truth, at, n_stretches, spread, rng);
    for (int spoiled = 0; spoiled < n_spoiled && spoiled_information > 0; ++spoiled) {
      // A derivative across a contact: a residual of the usual size, against a number that means nothing.
      const VectorXd jacobian = std::sqrt(spoiled_information) * Pair(rng.Normal(), rng.Normal());
      stretches.push_back({jacobian * jacobian.transpose(), jacobian * rng.Normal()});
    }
    const StretchEstimate estimate = EstimateFromStretches(stretches, at, Prior::Uniform(2));
    for (int i = 0; i < 2; ++i) {
      held += std::abs(at[i] + estimate.step[i] - truth[i]) <= 1.645 * std::sqrt(estimate.covariance(i, i));
    }
  }
  return held;
}

// Of 400 intervals 360 are expected to hold, with a standard deviation of 6.
TEST(EstimateFromStretches, UnderAGaussianPriorAloneItIsThatPrior) {
  Eigen::Matrix2d covariance;
  covariance << 0.25, 0.06, 0.06, 0.09;
  const Prior prior = Prior::Gaussian(Eigen::Vector2d(0.5, -0.2), covariance);
  const StretchEstimate estimate = EstimateFromStretches({}, Eigen::Vector2d(3, 3), prior);
  EXPECT_NEAR(estimate.step[0], -2.5, 1e-12);
  EXPECT_NEAR(estimate.step[1], -3.2, 1e-12);
  EXPECT_LT((estimate.covariance - covariance).norm(), 1e-12);
}

TEST(EstimateFromStretches, NinetyPercentIntervalsHoldTheTruthWhereNoiseIsAsBelieved) {
  for (const int n_stretches : {12, 60}) {
    EXPECT_GE(Held(200, n_stretches, 1, 0), 342) << n_stretches;
    EXPECT_LE(Held(200, n_stretches, 1, 0), 390) << n_stretches;
  }
}

TEST(EstimateFromStretches, AndWhereItIsThreeTimesAsLargeAsBelieved) {
  EXPECT_GE(Held(200, 40, 3, 0), 342);
  EXPECT_LE(Held(200, 40, 3, 0), 385);
}

TEST(EstimateFromStretches, AndWhereOneStretchHasADerivativeThatMeansNothing) {
  // Taken at its word it would hold x, in one direction, at where it stands: 0.1 away, some hundred standard
  // deviations.
  EXPECT_GE(Held(200, 40, 1, 1e8), 342);
  EXPECT_LE(Held(200, 40, 1, 1e8), 395);
}

TEST(EstimateFromStretches, AndWhereSeveralOfManyDo) {
  EXPECT_GE(Held(200, 150, 1, 1e4, 4), 342);
  EXPECT_LE(Held(200, 150, 1, 1e4, 4), 395);
}

TEST(EstimateFromStretches, WhatFewStretchesOfManyTellTheseDecide) {
  const VectorXd truth = Pair(0.3, -0.7), at = truth + Pair(0.1, -0.1);
  for (const int n_telling : {5, 10, 40}) {
    int held = 0;
    double widest = 0;
    for (int k = 0; k < 200; ++k) {
      Rng rng = RngKey(3).Index(static_cast<uint64_t>(k)).MakeRng();
      auto stretches = Linear(truth, at, 150, 1, rng);
      for (size_t i = static_cast<size_t>(n_telling); i < stretches.size();
           ++i) {  // the others tell of the first alone
        stretches[i].information.row(1).setZero();
        stretches[i].information.col(1).setZero();
        stretches[i].score[1] = 0;
      }
      const StretchEstimate estimate = EstimateFromStretches(stretches, at, Prior::Uniform(2));
      held += std::abs(at[1] + estimate.step[1] - truth[1]) <= 1.645 * std::sqrt(estimate.covariance(1, 1));
      widest = std::max(widest, std::sqrt(estimate.covariance(1, 1)));
    }
    EXPECT_GE(held, 165) << n_telling;
    EXPECT_LT(widest, 4 / std::sqrt(n_telling * kReadings)) << n_telling;
  }
}

/// How many of `n_cases` 90 % intervals hold the parameters of another log, of two of each: they differ by kVariation
/// from one eighth of a log to the next.
template <class Estimate>
int HeldByAnotherLog(int n_cases, const Estimate& estimate_from) {
  constexpr double kVariation = 0.2;
  constexpr int kParts = 8, kPerPart = 12;
  int held = 0;
  for (int k = 0; k < n_cases; ++k) {
    Rng rng = RngKey(4).Index(static_cast<uint64_t>(k)).MakeRng();
    const VectorXd mean = Pair(rng.Uniform(-1, 1), rng.Uniform(-1, 1)), at = mean + Pair(0.1, -0.1);
    const auto drawn = [&] { return VectorXd(mean + kVariation * Pair(rng.Normal(), rng.Normal())); };
    std::vector<StretchEvidence> stretches;
    for (int part = 0; part < kParts; ++part) {
      for (StretchEvidence& stretch : Linear(drawn(), at, kPerPart, 1, rng)) {
        stretch.row = static_cast<int>(stretches.size());
        stretches.push_back(stretch);
      }
    }
    std::reverse(stretches.begin(), stretches.end());  // their order is of no account
    const StretchEstimate estimate = estimate_from(stretches, at, Prior::Uniform(2));
    const VectorXd other = drawn();
    for (int i = 0; i < 2; ++i) {
      held += std::abs(at[i] + estimate.step[i] - other[i]) <= 1.645 * std::sqrt(estimate.covariance(i, i));
    }
  }
  return held;
}

TEST(EstimateFromParts, HoldsWhatAnotherLogAsksForWhereParametersVary) {
  EXPECT_GE(HeldByAnotherLog(200, EstimateFromParts), 330);
  EXPECT_LE(HeldByAnotherLog(200, EstimateFromParts), 385);
  EXPECT_LT(HeldByAnotherLog(200, EstimateFromStretches), 280);
}

TEST(EstimateFromStretches, WithoutEvidenceIsThePrior) {
  const StretchEstimate estimate = EstimateFromStretches({}, Pair(0.5, -2), Prior::Uniform(2));
  EXPECT_LT((estimate.step - Pair(-0.5, 2)).norm(), 1e-12);
  EXPECT_LT((estimate.covariance - MatrixXd::Identity(2, 2) * kPriorStd * kPriorStd).norm(), 1e-12);
}

}  // namespace oted::stretch_estimate_test
