#include "oted/matching/discriminator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::discriminator_test {

constexpr double kDataMean = 0.5, kSimMean = -0.5;

/// (n, 2): the first feature is N(mean, 1), the second N(0, 1) whoever made it.
Array2<double> Draw(int n, double mean, Rng& rng) {
  Array2<double> rows(n, 2);
  for (int i = 0; i < n; ++i) {
    rows(i, 0) = mean + rng.Normal();
    rows(i, 1) = rng.Normal();
  }
  return rows;
}

Discriminator Make(uint64_t seed = 1,
                   const DiscriminatorConfig& options = {.hidden = {32, 32}, .learning_rate = 2e-3}) {
  Rng rng(seed);
  return Discriminator(Draw(2000, kDataMean, rng), options, rng);
}

TEST(MinusLogOneMinusG, IsTheSoftplusOfTheLogitWithoutOverflow) {
  EXPECT_DOUBLE_EQ(MinusLogOneMinusG(0), std::numbers::ln2);
  for (const double f : {-20.0, -3.0, -0.1, 0.7, 5.0, 20.0}) {
    const double g = 1 / (1 + std::exp(-f));
    EXPECT_NEAR(MinusLogOneMinusG(f), -std::log(1 - g), 1e-7 * (1 + std::abs(f))) << f;
  }
  EXPECT_EQ(MinusLogOneMinusG(1e4), 1e4);
  EXPECT_EQ(MinusLogOneMinusG(-1e4), 0);
}

TEST(Discriminator, TheLogitApproachesTheLogRatioOfTwoKnownGaussians) {
  Discriminator g = Make();
  Rng rng(2);
  for (int step = 0; step < 1500; ++step) g.Step(Draw(256, kDataMean, rng), Draw(256, kSimMean, rng));
  Array2<double> probes = Draw(500, kDataMean, rng);
  const Array2<double> simulated = Draw(500, kSimMean, rng);
  for (int i = 0; i < simulated.rows(); ++i) probes.AppendRow(simulated.row(i));
  const std::vector<double> logits = g.Logits(probes);
  double error = 0, sum_f = 0, sum_r = 0, ff = 0, rr = 0, fr = 0;
  const double n = probes.rows();
  for (int i = 0; i < probes.rows(); ++i) {
    // log N(x; 0.5, 1) - log N(x; -0.5, 1) = x.
    const double f = logits[static_cast<size_t>(i)], r = probes(i, 0);
    error += std::abs(f - r) / n;
    sum_f += f / n;
    sum_r += r / n;
    ff += f * f / n;
    rr += r * r / n;
    fr += f * r / n;
  }
  const double correlation = (fr - sum_f * sum_r) / std::sqrt((ff - sum_f * sum_f) * (rr - sum_r * sum_r));
  EXPECT_GT(correlation, 0.98);
  EXPECT_LT(error, 0.15);
}

TEST(Discriminator, UnequalBatchSizesDoNotShiftTheRatio) {
  Discriminator g = Make(3);
  Rng rng(4);
  for (int step = 0; step < 800; ++step) g.Step(Draw(256, 0, rng), Draw(32, 0, rng));
  double mean = 0;
  for (const double f : g.Logits(Draw(1000, 0, rng))) mean += f / 1000;
  EXPECT_NEAR(mean, 0, 0.1);  // with unbalanced weights it would be log 8 = 2.08
}

TEST(Discriminator, ABlindOneHasTheLossTwoLogTwo) {
  // Equal distributions: whatever the fresh network says of one row, it says of the other kind as well.
  Discriminator g = Make(5);
  Rng rng(6);
  EXPECT_NEAR(g.Step(Draw(4000, kDataMean, rng), Draw(4000, kDataMean, rng)).loss, 2 * std::numbers::ln2, 0.1);
  double last = 0;
  for (int step = 0; step < 400; ++step) {
    const double loss = g.Step(Draw(256, kDataMean, rng), Draw(256, kDataMean, rng)).loss;
    if (step >= 300) last += loss / 100;
  }
  EXPECT_NEAR(last, 2 * std::numbers::ln2, 0.02);
}

TEST(Discriminator, StepReturnsEquationTwoBeforeTheStep) {
  Discriminator g = Make(7);
  Rng rng(8);
  const auto data = Draw(40, kDataMean, rng), sim = Draw(25, kSimMean, rng);
  double expected = 0;
  for (const double f : g.Logits(data)) expected += MinusLogOneMinusG(-f) / 40;
  for (const double f : g.Logits(sim)) expected += MinusLogOneMinusG(f) / 25;
  EXPECT_NEAR(g.Step(data, sim).loss, expected, 1e-6);
  EXPECT_LT(g.Step(data, sim).loss, expected);
}

TEST(Discriminator, ARunAwaySimulatorGivesFiniteLogits) {
  Discriminator g = Make(9);
  Array2<double> far(2, 2, 1e30);
  far(1, 0) = -1e30;
  for (const double f : g.Logits(far)) EXPECT_TRUE(std::isfinite(f));
}

TEST(Discriminator, SavedAndRestoredItGoesOnWithTheSameNumbers) {
  Discriminator g = Make(10), other = Make(11);
  Rng rng(12);
  for (int step = 0; step < 5; ++step) g.Step(Draw(64, kDataMean, rng), Draw(64, kSimMean, rng));
  NpzArrays arrays;
  g.Save(arrays);
  other.Restore(ParseNpz(NpzBytes(arrays), "memory"), "memory");
  for (int step = 0; step < 5; ++step) {
    const auto data = Draw(64, kDataMean, rng), sim = Draw(64, kSimMean, rng);
    EXPECT_EQ(g.Step(data, sim).loss, other.Step(data, sim).loss);
    EXPECT_EQ(g.Logits(data), other.Logits(data));
  }
}

TEST(Discriminator, ADamagedFileIsADataError) {
  Discriminator g = Make(13);
  NpzArrays arrays;
  g.Save(arrays);
  for (const auto& [name, array] : arrays) {
    SCOPED_TRACE(name);
    NpzArrays without = arrays, wrong = arrays;
    without.erase(name);
    wrong[name] = NpyArray(std::vector<double>{});
    Discriminator other = Make(14);
    MessageOf<DataError>([&] { other.Restore(without, "d.npz"); });
    MessageOf<DataError>([&] { other.Restore(wrong, "d.npz"); });
  }
}

}  // namespace oted::discriminator_test
