#include "oted/stages/design/images/posterior.h"

#include <gtest/gtest.h>

#include <cmath>

namespace oted::posterior_test {

ParameterSpace UnitSpace(int d) {
  std::vector<ParameterSpec> specs;
  for (int i = 0; i < d; ++i) {
    specs.push_back({.name = std::string(1, static_cast<char>('a' + i)),
                     .field = "env/x",
                     .low = 0,
                     .high = 1,
                     .scale = ParameterScale::kAbsolute});
  }
  return ParameterSpace(specs);
}

double Logit(double u) { return std::log(u / (1 - u)); }

TEST(Posterior, AGaussianLikelihoodInXHasTheConjugateAnswer) {
  // x1 + x2 is measured as 1 with variance 0.04, x1 - x2 as 0.4 with variance 0.01.
  const LogLikelihoods likelihoods = [](const Array2<double>& u) {
    std::vector<double> values;
    for (int k = 0; k < u.rows(); ++k) {
      const double a = Logit(u(k, 0)), b = Logit(u(k, 1));
      values.push_back(-0.5 * std::pow(a + b - 1, 2) / 0.04 - 0.5 * std::pow(a - b - 0.4, 2) / 0.01);
    }
    return values;
  };
  const Designer q = Posterior(Designer(UnitSpace(2), 1.0), likelihoods, RngKey(1));
  const double prior_precision = 1 / (Designer::kPriorStd * Designer::kPriorStd);
  Eigen::Matrix2d precision;
  precision << 25 + 100 + prior_precision, 25 - 100, 25 - 100, 25 + 100 + prior_precision;
  const Eigen::Matrix2d covariance = precision.inverse();
  const Eigen::Vector2d mean = covariance * Eigen::Vector2d(25 + 40, 25 - 40);
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(q.mean()[static_cast<size_t>(i)], mean[i], 0.01);
    for (int j = 0; j < 2; ++j) EXPECT_NEAR(q.Covariance()(i, j), covariance(i, j), 0.05 * covariance(0, 0));
  }
}

TEST(Posterior, AVeryNarrowLikelihoodFarFromThePriorsMeanIsFound) {
  const LogLikelihoods likelihoods = [](const Array2<double>& u) {
    std::vector<double> values;
    for (int k = 0; k < u.rows(); ++k) values.push_back(-0.5 * std::pow((Logit(u(k, 0)) - 4) / 1e-3, 2));
    return values;
  };
  const Designer q = Posterior(Designer(UnitSpace(1), 1.0), likelihoods, RngKey(1));
  EXPECT_NEAR(q.mean()[0], 4, 2e-4);
  EXPECT_NEAR(std::sqrt(q.Covariance()(0, 0)), 1e-3, 1e-4);
}

TEST(Posterior, ASkewedLikelihoodIsAnsweredByItsModeAndItsSpread) {
  // Gamma-shaped in x: mode 1 - prior's pull, mean 0.25 above it. f(x) = 4 log(x + 1) - 2 x for x > -1.
  const LogLikelihoods likelihoods = [](const Array2<double>& u) {
    std::vector<double> values;
    for (int k = 0; k < u.rows(); ++k) {
      const double x = Logit(u(k, 0));
      values.push_back(x > -1 ? 4 * std::log(x + 1) - 2 * x : -1e3);
    }
    return values;
  };
  const Designer q = Posterior(Designer(UnitSpace(1), 1.0), likelihoods, RngKey(1));
  double sum = 0, mean = 0, square = 0, mode = 0, highest = -1e9;
  for (double x = -0.999; x < 12; x += 0.001) {
    const double log_density = 4 * std::log(x + 1) - 2 * x - 0.5 * x * x / (Designer::kPriorStd * Designer::kPriorStd);
    const double density = std::exp(log_density);
    sum += density;
    mean += density * x;
    square += density * x * x;
    if (log_density > highest) mode = x, highest = log_density;
  }
  mean /= sum;
  ASSERT_GT(mean - mode, 0.15);
  EXPECT_NEAR(q.mean()[0], mode, 0.03);
  EXPECT_NEAR(std::sqrt(q.Covariance()(0, 0)), std::sqrt(square / sum - mean * mean), 0.03);
}

TEST(Posterior, WithoutEvidenceAGaussianIsThePriorAndAGridUniform) {
  const LogLikelihoods nothing = [](const Array2<double>& u) {
    return std::vector<double>(static_cast<size_t>(u.rows()), 3.0);
  };
  const Designer q = Posterior(Designer(UnitSpace(1), 0.3), nothing, RngKey(1));
  EXPECT_NEAR(q.mean()[0], 0, 0.1);
  EXPECT_NEAR(std::sqrt(q.Covariance()(0, 0)), Designer::kPriorStd, 0.1);
  const Designer grid = Posterior(Designer::OnGrid(UnitSpace(1), 0.25), nothing, RngKey(1));
  for (const double p : grid.grid()->probabilities(0)) EXPECT_NEAR(p, 0.2, 1e-12);
}

TEST(Posterior, AGridHasTheMarginalsOfTheLikelihood) {
  // Two parameters on {0, 0.5, 1}: what counts is whether they are equal, and a is twice as likely 0 as anything else.
  const LogLikelihoods likelihoods = [](const Array2<double>& u) {
    std::vector<double> values;
    for (int k = 0; k < u.rows(); ++k) {
      values.push_back((u(k, 0) == u(k, 1) ? std::log(8.0) : 0.0) + (u(k, 0) == 0 ? std::log(2.0) : 0.0));
    }
    return values;
  };
  const Designer q = Posterior(Designer::OnGrid(UnitSpace(2), 0.5), likelihoods, RngKey(1));
  EXPECT_NEAR(q.grid()->probabilities(0)[0], 20.0 / 40, 1e-12);
  EXPECT_NEAR(q.grid()->probabilities(0)[1], 10.0 / 40, 1e-12);
  EXPECT_NEAR(q.grid()->probabilities(1)[0], (16.0 + 1 + 1) / 40, 1e-12);
}

TEST(Posterior, AGridOfMoreCombinationsThanAreCountedIsSampled) {
  // Six parameters of eleven values each, of which the last alone is measured.
  const LogLikelihoods likelihoods = [](const Array2<double>& u) {
    std::vector<double> values;
    for (int k = 0; k < u.rows(); ++k) values.push_back(u(k, 5) > 0.45 ? 2.0 : -2.0);
    return values;
  };
  const Designer q = Posterior(Designer::OnGrid(UnitSpace(6), 0.1), likelihoods, RngKey(1));
  EXPECT_NEAR(q.grid()->probabilities(0)[3], 1.0 / 11, 0.02);
  EXPECT_NEAR(q.grid()->probabilities(5)[7], 1.0 / 6, 0.03);
  EXPECT_LT(q.grid()->probabilities(5)[2], 0.02);
}

TEST(Posterior, OfAGaussianLikelihoodAndAGaussianPriorIsTheirProduct) {
  // Likelihood N(x; 1, 0.5^2), prior N(-1, 0.8^2).
  const auto likelihoods = [](const Array2<double>& u) {
    std::vector<double> values;
    for (int k = 0; k < u.rows(); ++k) {
      const double x = std::log(u(k, 0) / (1 - u(k, 0)));
      values.push_back(-0.5 * (x - 1) * (x - 1) / 0.25);
    }
    return values;
  };
  Designer prior(UnitSpace(1), 1.0);
  prior.SetPrior(Prior::Gaussian(-Eigen::VectorXd::Ones(1), 0.64 * Eigen::MatrixXd::Identity(1, 1)));
  const Designer q = Posterior(prior, likelihoods, RngKey(1));
  const double precision = 1 / 0.25 + 1 / 0.64;
  EXPECT_NEAR(q.mean()[0], (1 / 0.25 - 1 / 0.64) / precision, 0.03);
  EXPECT_NEAR(std::exp(q.log_std()[0]), std::sqrt(1 / precision), 0.03);
  EXPECT_FALSE(q.prior().uniform);
  // On a grid: probabilities times likelihood.
  Designer grid = Designer::OnGrid(UnitSpace(1), 0.25);
  Prior of_values = Prior::Uniform(1);
  of_values.uniform = false;
  of_values.values = {{0.1, 0.2, 0.4, 0.2, 0.1}};
  grid.SetPrior(of_values);
  const auto flat = [](const Array2<double>& u) { return std::vector<double>(static_cast<size_t>(u.rows()), 0.0); };
  EXPECT_NEAR(Posterior(grid, flat, RngKey(1)).grid()->probabilities(0)[2], 0.4, 1e-9);
}

}  // namespace oted::posterior_test
