#include "oted/stages/design/images/ratio_estimator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace oted::ratio_estimator_test {

/// A simulator and a behaviour: s ~ N(0, 1); a = gain s + noise; o = a + 2 z + N(0, 0.5^2). Rows (s, a, o).
std::vector<double> Row(double z, double gain, double noise, Rng& rng) {
  const double s = rng.Normal(), a = gain * s + noise * rng.Normal();
  return {s, a, a + 2 * z + 0.5 * rng.Normal()};
}

/// log p(o | a, z): what the behaviour adds is the same for every z.
double LogLikelihood(std::span<const double> row, double z) {
  const double off = (row[2] - row[1] - 2 * z) / 0.5;
  return -0.5 * off * off;
}

/// Trained on simulators with the behaviour (gain 1, noise 1), z uniform in the unit interval.
RatioEstimator Trained() {
  constexpr int kSteps = 4000, kSims = 32;
  Rng rng = RngKey(1).MakeRng();
  Array2<double> seen;
  for (int i = 0; i < 500; ++i) seen.AppendRow(Row(rng.Uniform(), 1, 1, rng));
  Rng init = RngKey(2).MakeRng();
  RatioEstimator g(seen, {}, 1, {.size = {.hidden = {32, 32}, .filters = {}}, .learning_rate = 5e-3, .n_steps = kSteps},
                   init);
  for (int step = 0; step < kSteps; ++step) {
    Array2<double> u, rows;
    std::vector<int> of;
    for (int k = 0; k < kSims; ++k) {
      u.AppendRow(std::vector<double>{rng.Uniform()});
      for (int i = 0; i < 2; ++i) {
        rows.AppendRow(Row(u(k, 0), 1, 1, rng));
        of.push_back(k);
      }
    }
    std::vector<std::span<const double>> samples;
    for (int i = 0; i < rows.rows(); ++i) samples.push_back(std::as_const(rows).row(i));
    g.Step(samples, of, u);
  }
  return g;
}

Array2<double> Points(const std::vector<double>& z) {
  Array2<double> u;
  for (const double value : z) u.AppendRow(std::vector<double>{value});
  return u;
}

TEST(RatioEstimator, ItsRatiosAreThoseOfTheLikelihoodsWhoeverActs) {
  RatioEstimator g = Trained();
  Rng rng = RngKey(3).MakeRng();
  // The simulators' own behaviour, and one that they never saw: it leans the other way and trembles less.
  for (const auto& [gain, noise] : {std::pair(1.0, 1.0), std::pair(-0.5, 0.3)}) {
    double square = 0;
    for (int i = 0; i < 200; ++i) {
      Array2<double> one;
      one.AppendRow(Row(0.5, gain, noise, rng));
      const std::vector<double> values = g.LogLikelihoods(g.Features(one), Points({0.35, 0.65}));
      const double truth = LogLikelihood(one.row(0), 0.65) - LogLikelihood(one.row(0), 0.35);
      square += std::pow(values[1] - values[0] - truth, 2) / 200;
    }
    EXPECT_LT(std::sqrt(square), 0.2) << "gain " << gain;  // of ratios that are spread by 1.2
  }
}

TEST(RatioEstimator, ALogsSumPeaksAtTheSimulatorItWasMadeIn) {
  RatioEstimator g = Trained();
  Rng rng = RngKey(4).MakeRng();
  constexpr int kEpisodes = 100;
  Array2<double> logs;
  double mean = 0;
  for (int i = 0; i < kEpisodes; ++i) {
    logs.AppendRow(Row(0.3, 0.2, 0.5, rng));
    mean += (logs(i, 2) - logs(i, 1)) / 2 / kEpisodes;  // the maximum-likelihood estimate
  }
  std::vector<double> grid;
  for (int k = 0; k <= 100; ++k) grid.push_back(k / 100.0);
  const std::vector<double> values = g.LogLikelihoods(g.Features(logs), Points(grid));
  const double peak = static_cast<double>(std::ranges::max_element(values) - values.begin()) / 100;
  EXPECT_NEAR(peak, mean, 0.025);  // its standard error
}

TEST(RatioEstimator, AFreshOneKnowsNothingAndItsLossIsThatOfGuessing) {
  Rng rng = RngKey(5).MakeRng(), init = RngKey(6).MakeRng();
  Array2<double> rows, u;
  std::vector<int> of;
  for (int k = 0; k < 64; ++k) {
    u.AppendRow(std::vector<double>{rng.Uniform()});
    rows.AppendRow(Row(u(k, 0), 1, 1, rng));
    of.push_back(k);
  }
  RatioEstimator g(rows, {}, 1, {}, init);
  std::vector<std::span<const double>> samples;
  for (int i = 0; i < rows.rows(); ++i) samples.push_back(std::as_const(rows).row(i));
  EXPECT_NEAR(g.Step(samples, of, u), std::log(64.0), 0.5);
}

}  // namespace oted::ratio_estimator_test
