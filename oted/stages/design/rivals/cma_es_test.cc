#include "oted/stages/design/rivals/cma_es.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace oted::cma_es_test {

using Eigen::VectorXd;
using Cost = std::function<double(const VectorXd&)>;

double Sphere(const VectorXd& x) { return x.squaredNorm(); }

/// Minimum 0 at (1, ..., 1), at the end of a curved valley.
double Rosenbrock(const VectorXd& x) {
  double sum = 0;
  for (int i = 0; i + 1 < x.size(); ++i) {
    sum += 100 * std::pow(x[i + 1] - x[i] * x[i], 2) + std::pow(1 - x[i], 2);
  }
  return sum;
}

/// Axes of which the longest is a thousand times the shortest.
double Ellipsoid(const VectorXd& x) {
  double sum = 0;
  for (int i = 0; i < x.size(); ++i) sum += std::pow(1e6, i / (x.size() - 1.0)) * x[i] * x[i];
  return sum;
}

VectorXd Minimize(const Cost& cost, const VectorXd& start, int n_evaluations, uint64_t seed = 1) {
  CmaEs search(start, 0.5);
  Rng rng = RngKey(seed).MakeRng();
  for (int done = 0; done < n_evaluations; done += search.population()) {
    const std::vector<VectorXd> points = search.Ask(rng);
    std::vector<double> costs;
    for (const VectorXd& point : points) costs.push_back(cost(point));
    search.Tell(points, costs);
  }
  return search.mean();
}

// Budgets: about half as much again as the evaluations that the tutorial's algorithm is known to need in dimension 5.
TEST(CmaEs, FindsTheMinimumOfASphere) { EXPECT_LT(Minimize(Sphere, VectorXd::Constant(5, 3), 2000).norm(), 1e-6); }

TEST(CmaEs, FollowsACurvedValleyToItsEnd) {
  EXPECT_LT((Minimize(Rosenbrock, VectorXd::Zero(5), 6000) - VectorXd::Ones(5)).norm(), 1e-6);
}

TEST(CmaEs, LearnsTheAxesOfAnIllConditionedEllipsoid) {
  EXPECT_LT(Minimize(Ellipsoid, VectorXd::Constant(5, 3), 6000).norm(), 1e-6);
}

TEST(CmaEs, RotatingTheAxesDoesNotHinderIt) {
  const Eigen::MatrixXd rotation = Eigen::HouseholderQR<Eigen::MatrixXd>(Eigen::MatrixXd::Random(5, 5)).householderQ();
  EXPECT_LT(Minimize([&](const VectorXd& x) { return Ellipsoid(rotation * x); }, VectorXd::Constant(5, 3), 6000).norm(),
            1e-6);
}

TEST(CmaEs, OnlyTheOrderOfCostsMatters) {
  const VectorXd start = VectorXd::Constant(3, 2);
  EXPECT_EQ(Minimize(Sphere, start, 400),
            Minimize([](const VectorXd& x) { return std::log(Sphere(x)) * 1e3 - 7; }, start, 400));
}

TEST(CmaEs, ItsCovarianceBecomesTheInverseHessianUpToAFactor) {
  CmaEs search(VectorXd::Constant(2, 1), 0.5);
  Rng rng = RngKey(3).MakeRng();
  for (int generation = 0; generation < 60; ++generation) {
    const std::vector<VectorXd> points = search.Ask(rng);
    std::vector<double> costs;
    for (const VectorXd& p : points) costs.push_back(p[0] * p[0] + 100 * p[1] * p[1]);
    search.Tell(points, costs);
  }
  EXPECT_NEAR(std::log10(search.covariance()(0, 0) / search.covariance()(1, 1)), 2, 0.7);
}

TEST(CmaEs, PointsWithoutACostAreTheWorst) {
  const auto half_defined = [](const VectorXd& x) { return x[0] < 0 ? std::nan("") : (x.array() - 1).square().sum(); };
  EXPECT_LT((Minimize(half_defined, VectorXd::Constant(3, 2), 1500) - VectorXd::Ones(3)).norm(), 1e-6);
}

TEST(CmaEs, ItsStreamIsNamedByItsKey) {
  const VectorXd start = VectorXd::Constant(4, 2);
  EXPECT_EQ(Minimize(Sphere, start, 200, 5), Minimize(Sphere, start, 200, 5));
  EXPECT_NE(Minimize(Sphere, start, 200, 5), Minimize(Sphere, start, 200, 6));
}

}  // namespace oted::cma_es_test
