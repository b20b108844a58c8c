#include "oted/matching/designer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::designer_test {

ParameterSpace Space() {
  return ParameterSpace({{.name = "friction", .field = "env/friction", .low = 0.2, .high = 2.0},
                         {.name = "gain", .field = "env/gain", .low = 0.1, .high = 10.0, .logarithmic = true}});
}

Designer At(std::vector<double> mean, std::vector<double> log_std) {
  Designer designer(Space(), 1.0);
  designer.Restore(std::move(mean), std::move(log_std));
  return designer;
}

/// Without advantages Ascend follows -lambda dKL, by numerical differences, times the inverse Fisher information: std^2
/// and 1/2.
/// @param at  makes q from its mean and log spread
template <class MakeQ>
void ExpectAscentAgainstTheKl(const MakeQ& at, const std::vector<double>& mean, const std::vector<double>& log_std,
                              double step, double tolerance) {
  const double h = 1e-6, lambda = 0.3;
  Designer stepped = at(mean, log_std);
  Rng rng(1);
  stepped.Ascend({stepped.Draw(rng)}, std::vector{0.0}, {lambda, step, step});
  for (size_t i = 0; i < 2; ++i) {
    std::vector<double> up = mean, down = mean;
    up[i] += h;
    down[i] -= h;
    const double d_mean = (at(up, log_std).KlToPrior() - at(down, log_std).KlToPrior()) / (2 * h);
    up = down = log_std;
    up[i] += h;
    down[i] -= h;
    const double d_log_std = (at(mean, up).KlToPrior() - at(mean, down).KlToPrior()) / (2 * h);
    EXPECT_NEAR((stepped.mean()[i] - mean[i]) / step, -lambda * std::exp(2 * log_std[i]) * d_mean, tolerance);
    EXPECT_NEAR((stepped.log_std()[i] - log_std[i]) / step, -lambda * 0.5 * d_log_std, tolerance);
  }
}

TEST(Designer, KlIsZeroAtThePriorAndItsGradientIsTheOneThatAscendFollows) {
  EXPECT_NEAR(At({0, 0}, {std::log(Designer::kPriorStd), std::log(Designer::kPriorStd)}).KlToPrior(), 0, 1e-12);
  ExpectAscentAgainstTheKl(At, {0.7, -1.1}, {-0.9, 0.3}, 1e-3, 1e-6);
}

TEST(Designer, TheRewardsGradientIsThatOfItsExpectation) {
  // R(x) = b x_0 + c x_1^2 has E[R] = b mean_0 + c (mean_1^2 + std_1^2): natural gradients in closed form.
  const double b = 0.7, c = -0.4, step = 1e-3;
  Designer designer = At({0.5, 0.8}, {-0.5, -0.2});
  const std::vector<double> mean = designer.mean(), log_std = designer.log_std();
  const double var0 = std::exp(2 * log_std[0]), var1 = std::exp(2 * log_std[1]);
  Rng rng(2);
  std::vector<Designer::Sample> draws;
  std::vector<double> advantages;
  const double baseline = b * mean[0] + c * (mean[1] * mean[1] + var1);
  for (int k = 0; k < 200000; ++k) {
    draws.push_back(designer.Draw(rng));
    const auto& x = draws.back().x;
    advantages.push_back(b * x[0] + c * x[1] * x[1] - baseline);
  }
  designer.Ascend(draws, advantages, {0, step, step});
  EXPECT_NEAR((designer.mean()[0] - mean[0]) / step, var0 * b, 0.01);
  EXPECT_NEAR((designer.mean()[1] - mean[1]) / step, var1 * 2 * c * mean[1], 0.01);
  EXPECT_NEAR((designer.log_std()[0] - log_std[0]) / step, 0, 0.01);
  EXPECT_NEAR((designer.log_std()[1] - log_std[1]) / step, 0.5 * 2 * c * var1, 0.01);
}

TEST(Designer, AscendsToTheMaximumAndLeavesWhatHasNoEffectAtThePrior) {
  const ParameterSpace space = Space();
  Designer designer(space, 1.0);
  const double truth_u = 0.8;  // of the first parameter; the second has no effect
  Rng rng(3);
  for (int iteration = 0; iteration < 400; ++iteration) {
    std::vector<Designer::Sample> draws;
    std::vector<double> rewards;
    double mean = 0;
    for (int k = 0; k < 32; ++k) {
      draws.push_back(k % 2 == 0 ? designer.Draw(rng) : designer.Mirror(draws.back()));
      const double error = space.ToUnit(draws.back().z)[0] - truth_u;
      rewards.push_back(-20 * error * error);
      mean += rewards.back() / 32;
    }
    for (double& r : rewards) r -= mean;
    designer.Ascend(draws, rewards, {0.01, 0.2, 0.1});
  }
  EXPECT_NEAR(designer.Mode()[0], 0.2 + 1.8 * truth_u, 0.03);
  EXPECT_LT(std::exp(designer.log_std()[0]), 0.35);
  EXPECT_LT(std::abs(designer.mean()[1]), 1.0);
  EXPECT_GT(std::exp(designer.log_std()[1]), 0.8) << "the spread is the uncertainty, and must stay";
}

TEST(Designer, CentralIntervalsHoldTheirMassOfTheDraws) {
  const Designer designer = At({1.2, -0.4}, {-0.3, 0.4});
  Rng rng(4);
  constexpr int kN = 20000;
  std::vector<std::vector<double>> z;
  for (int k = 0; k < kN; ++k) z.push_back(designer.Draw(rng).z);
  for (const double mass : {0.5, 0.9, 0.99}) {
    const auto intervals = designer.CentralInterval(mass);
    for (size_t i = 0; i < 2; ++i) {
      double inside = 0, below = 0;
      for (const auto& draw : z) {
        inside += draw[i] >= intervals[i].low && draw[i] <= intervals[i].high;
        below += draw[i] < intervals[i].low;
      }
      const double five_errors = 5 * std::sqrt(mass * (1 - mass) / kN);
      EXPECT_NEAR(inside / kN, mass, five_errors);
      EXPECT_NEAR(below / kN, (1 - mass) / 2, five_errors);
    }
  }
}

TEST(Designer, ANarrowQHasTheDeviationOfItsDrawsAndAWideOneThatOfThePriorAtMost) {
  const Designer narrow = At({0.9, -0.6}, {std::log(0.02), std::log(0.03)});
  Rng rng(5);
  std::vector<double> sum(2, 0), squares(2, 0);
  constexpr int kN = 20000;
  for (int k = 0; k < kN; ++k) {
    const auto z = narrow.Draw(rng).z;
    for (size_t i = 0; i < 2; ++i) {
      sum[i] += z[i] / kN;
      squares[i] += z[i] * z[i] / kN;
    }
  }
  for (size_t i = 0; i < 2; ++i) {
    const double std = std::sqrt(squares[i] - sum[i] * sum[i]);
    EXPECT_NEAR(narrow.Std()[i], std, 0.05 * std);
    EXPECT_NEAR(narrow.Mode()[i], sum[i], 0.1 * std);
  }
  EXPECT_LE(At({0, 0}, {0.7, 0.7}).Std()[0], 1.8 / std::sqrt(12.0));
}

TEST(Designer, DrawsStayInsideTheBoundsAndMirrorsLieOppositeTheMean) {
  const Designer designer = At({5.9, -6.0}, {0.75, 0.75});
  Rng rng(6);
  for (int k = 0; k < 1000; ++k) {
    const auto draw = designer.Draw(rng), mirror = designer.Mirror(draw);
    EXPECT_NO_THROW(Space().CheckInside(draw.z));
    EXPECT_NO_THROW(Space().CheckInside(mirror.z));
    for (size_t i = 0; i < 2; ++i) EXPECT_NEAR(0.5 * (draw.x[i] + mirror.x[i]), designer.mean()[i], 1e-12);
  }
}

TEST(Designer, QJsonRoundTrips) {
  const Designer designer = At({1.23456789, -0.4}, {-2.5, 0.3});
  const nlohmann::json q = nlohmann::json::parse(designer.ToJson(0.05).dump());
  EXPECT_EQ(q["schema"], "oted.q/1");
  EXPECT_EQ(q["lambda"], 0.05);
  EXPECT_EQ(q["mode"].get<std::vector<double>>(), designer.Mode());
  const Designer read = Designer::FromJson(q, Space(), "q.json");
  EXPECT_EQ(read.mean(), designer.mean());
  for (size_t i = 0; i < 2; ++i) EXPECT_NEAR(read.log_std()[i], designer.log_std()[i], 1e-14);
  EXPECT_EQ(read.Mode(), designer.Mode());
}

Designer Correlated() {
  const Eigen::Vector2d mean(0.3, -0.4);
  Eigen::Matrix2d covariance;
  covariance << 0.09, -0.048, -0.048, 0.04;  // standard deviations 0.3 and 0.2, correlation -0.8
  return Designer(Space(), mean, covariance);
}

TEST(Designer, DrawsOfACorrelatedQHaveItsCovariance) {
  const Designer designer = Correlated();
  EXPECT_NEAR(designer.Correlation()(0, 1), -0.8, 1e-12);
  Rng rng(8);
  constexpr int kN = 40000;
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
  for (int k = 0; k < kN; ++k) {
    const auto x = designer.Draw(rng).x;
    const Eigen::Vector2d noise(x[0] - 0.3, x[1] + 0.4);
    second += noise * noise.transpose() / kN;
  }
  EXPECT_TRUE(second.isApprox(designer.Covariance(), 0.03)) << second;
}

TEST(Designer, KlOfACorrelatedQIsTheGaussiansClosedForm) {
  // (tr S + |m|^2) / p^2 - d - ln det(S / p^2), halved, with det S = 0.09 * 0.04 * (1 - 0.8^2).
  const double p2 = Designer::kPriorStd * Designer::kPriorStd;
  const double determinant = 0.09 * 0.04 * 0.36 / (p2 * p2);
  EXPECT_NEAR(Correlated().KlToPrior(), 0.5 * ((0.13 + 0.25) / p2 - 2 - std::log(determinant)), 1e-12);
}

Prior Narrow() {
  Eigen::Matrix2d covariance;
  covariance << 0.25, 0.06, 0.06, 0.09;
  return Prior::Gaussian(Eigen::Vector2d(0.5, -0.2), covariance);
}

TEST(Designer, KlToAGaussianPriorIsTheClosedFormAndItsGradientTheOneThatAscendFollows) {
  const std::vector<double> mean = {0.7, -1.1}, log_std = {-0.9, 0.3};
  const auto at = [&](const std::vector<double>& m, const std::vector<double>& s) {
    Designer q = At(m, s);
    q.SetPrior(Narrow());
    return q;
  };
  // 1/2 (tr(P S) + d^T P d - 2 + ln det C / det S), P the inverse of C = [.25 .06; .06 .09], det C = 0.0189.
  const double det = 0.25 * 0.09 - 0.06 * 0.06, p00 = 0.09 / det, p11 = 0.25 / det, p01 = -0.06 / det;
  const double s0 = std::exp(-1.8), s1 = std::exp(0.6), d0 = 0.2, d1 = -0.9;
  const double expected =
      0.5 * (p00 * s0 + p11 * s1 + p00 * d0 * d0 + p11 * d1 * d1 + 2 * p01 * d0 * d1 - 2 + std::log(det / (s0 * s1)));
  EXPECT_NEAR(at(mean, log_std).KlToPrior(), expected, 1e-10);
  ExpectAscentAgainstTheKl(at, mean, log_std, 1e-4, 1e-5);
}

TEST(Designer, WithoutRewardItSettlesAtAGaussianPriorWithoutItsCorrelation) {
  Designer q = At({2.0, 2.0}, {0.0, 0.0});
  q.SetPrior(Narrow());
  Rng rng(2);
  for (int step = 0; step < 600; ++step) q.Ascend({q.Draw(rng)}, std::vector{0.0}, {1.0, 0.1, 0.1});
  EXPECT_NEAR(q.mean()[0], 0.5, 1e-3);
  EXPECT_NEAR(q.mean()[1], -0.2, 1e-3);
  // The diagonal Gaussian nearest in KL(q, p) has the conditional variances, 1 / P_ii.
  const double det = 0.25 * 0.09 - 0.06 * 0.06;
  EXPECT_NEAR(std::exp(2 * q.log_std()[0]), det / 0.09, 1e-3);
  EXPECT_NEAR(std::exp(2 * q.log_std()[1]), det / 0.25, 1e-3);
}

TEST(Designer, StartsAtItsPriorAndKeepsItInItsFile) {
  Designer q(Space(), 1.2);
  q.SetPrior(Narrow());
  q.StartAtPrior(1.2);
  EXPECT_EQ(q.mean(), (std::vector<double>{0.5, -0.2}));
  EXPECT_NEAR(std::exp(q.log_std()[0]), 1.2 * 0.5 / Designer::kPriorStd, 1e-12);
  const Designer read = Designer::FromJson(nlohmann::json::parse(q.ToJson(0).dump()), Space(), "q.json");
  EXPECT_FALSE(read.prior().uniform);
  EXPECT_NEAR(read.KlToPrior(), q.KlToPrior(), 1e-9);
  nlohmann::json damaged = q.ToJson(0);
  damaged["prior"]["cov"][0][0] = -1;
  EXPECT_THROW(Designer::FromJson(damaged, Space(), "q.json"), DataError);
  // The uniform one starts where it always did.
  Designer uniform(Space(), 0.7);
  uniform.StartAtPrior(1.2);
  EXPECT_EQ(uniform.log_std(), Designer(Space(), 1.2).log_std());
}

TEST(Designer, OnAGridAGaussianPriorGivesEachValueTheMassAroundIt) {
  const ParameterSpace space({{.name = "density", .field = "env/density", .low = 0, .high = 1}});
  Designer q = Designer::OnGrid(space, 0.25);
  q.SetPrior(Prior::Gaussian(Eigen::VectorXd::Zero(1), 0.25 * Eigen::MatrixXd::Identity(1, 1)));
  q.StartAtPrior(1.2);
  // Between 3/8 and 5/8 lies |x| < ln(5/3), x ~ N(0, 0.5^2).
  EXPECT_NEAR(q.grid()->probabilities(0)[2], std::erf(std::log(5.0 / 3) / 0.5 / std::sqrt(2.0)), 1e-3);
  EXPECT_NEAR(q.KlToPrior(), 0, 1e-12);
  q.SetState({0.2, 0.2, 0.2, 0.2, 0.2});
  double kl = 0;
  for (const double p : q.grid()->prior()[0]) kl += 0.2 * std::log(0.2 / p);
  EXPECT_NEAR(q.KlToPrior(), kl, 1e-12);
  const Designer read = Designer::FromJson(nlohmann::json::parse(q.ToJson(0).dump()), space, "q.json");
  EXPECT_NEAR(read.KlToPrior(), kl, 1e-12);
}

TEST(Designer, QJsonKeepsCorrelations) {
  const nlohmann::json q = nlohmann::json::parse(Correlated().ToJson(0).dump());
  EXPECT_TRUE(Designer::FromJson(q, Space(), "q.json").Covariance().isApprox(Correlated().Covariance(), 1e-14));
}

TEST(Designer, OnAGridItsModeSpreadAndFileAreThoseOfTheProbabilities) {
  const ParameterSpace space({{.name = "density", .field = "env/density", .low = 0, .high = 0.6}});
  Designer designer = Designer::OnGrid(space, 0.3);
  designer.SetState({0.2, 0.7, 0.1});
  EXPECT_NEAR(designer.Mode()[0], 0.3, 1e-12);
  // Variance of the values, and of an even distribution over one step.
  EXPECT_NEAR(designer.Std()[0], std::sqrt(0.2 * 0.27 * 0.27 + 0.7 * 0.03 * 0.03 + 0.1 * 0.33 * 0.33 + 0.09 / 12),
              1e-12);
  const Designer::Interval interval = designer.CentralInterval(0.6)[0];
  EXPECT_NEAR(designer.Cumulative(0, interval.low), 0.2, 1e-9);
  EXPECT_NEAR(designer.Cumulative(0, interval.high), 0.8, 1e-9);
  Rng rng(3);
  for (const Designer::Sample& draw : designer.DrawBatch(20, rng)) {
    EXPECT_NEAR(draw.z[0], 0.3 * draw.x[0], 1e-12) << "x is the value's index";
  }
  const nlohmann::json q = nlohmann::json::parse(designer.ToJson(0.1).dump());
  EXPECT_EQ(q["kind"], "categorical");
  const Designer read = Designer::FromJson(q, space, "q.json");
  ASSERT_NE(read.grid(), nullptr);
  for (size_t i = 0; i < 3; ++i) {  // normalised once more
    EXPECT_NEAR(read.grid()->probabilities(0)[i], designer.grid()->probabilities(0)[i], 1e-15);
  }
  nlohmann::json damaged = q;
  damaged["probabilities"][0][1] = 0.0;
  EXPECT_THROW(Designer::FromJson(damaged, space, "q.json"), DataError);
}

TEST(Designer, OfAGaussianTheCumulativeIsHalfAtTheMode) {
  const Designer designer = At({0.7, -1.1}, {-0.9, 0.3});
  for (int i = 0; i < 2; ++i) {
    EXPECT_NEAR(designer.Cumulative(i, designer.Mode()[static_cast<size_t>(i)]), 0.5, 1e-9);
    EXPECT_NEAR(designer.Cumulative(i, designer.CentralInterval(0.9)[static_cast<size_t>(i)].high), 0.95, 1e-9);
  }
}

TEST(Designer, AForeignQIsADataErrorThatNamesTheFile) {
  const nlohmann::json q = At({1, 2}, {0, 0}).ToJson(0.1);
  const auto error_with = [&](const std::function<void(nlohmann::json&)>& change) {
    nlohmann::json changed = q;
    change(changed);
    const std::string message = MessageOf<DataError>([&] { Designer::FromJson(changed, Space(), "the/q.json"); });
    EXPECT_NE(message.find("the/q.json"), std::string::npos) << message;
  };
  error_with([](auto& j) { j = nlohmann::json::array(); });
  error_with([](auto& j) { j["schema"] = "oted.q/2"; });
  error_with([](auto& j) { j["kind"] = "categorical"; });
  for (const char* key : {"schema", "kind", "parameters", "bounds", "mean", "cov"}) {
    error_with([&](auto& j) { j.erase(key); });
  }
  error_with([](auto& j) { j["mean"] = {1.0}; });
  error_with([](auto& j) { j["cov"] = {{1.0}, {0.0}}; });
  error_with([](auto& j) { j["cov"] = {{1.0, 0.0}, {0.0, -1.0}}; });
  error_with([](auto& j) { j["cov"] = {{1.0, 2.0}, {2.0, 1.0}}; });
  error_with([](auto& j) { j["cov"] = {{1.0, 0.5}, {0.0, 1.0}}; });
  error_with([](auto& j) { j["mean"][0] = nullptr; });
  error_with([](auto& j) { j["parameters"][1] = "gravity"; });
  error_with([](auto& j) { j["bounds"][0][1] = 3.0; });
}

}  // namespace oted::designer_test
