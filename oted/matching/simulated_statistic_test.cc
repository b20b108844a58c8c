#include "oted/matching/simulated_statistic.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted {
namespace {

constexpr int kSide = 3;

/// Rows of 3x3 cells that are 1 with probability u, and one number that says nothing.
Array2<double> Cells(double u, int n, Rng& rng) {
  Array2<double> rows(n, kSide * kSide + 1);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < kSide * kSide; ++j) rows(i, j) = rng.Uniform() < u ? 1 : 0;
    rows(i, kSide * kSide) = rng.Normal();
  }
  return rows;
}

InputShape Shape() {
  InputShape shape{.image = {kSide, kSide, 1}, .levels = std::vector<int>(kSide * kSide, 2)};
  return shape.With(kSide * kSide, {0});
}

SimulatedStatistic Learn(uint64_t seed = 3) {
  Rng rng(1);
  std::vector<Array2<double>> samples;
  Array2<double> targets;
  for (int k = 0; k < 200; ++k) {
    const double u = rng.Uniform();
    samples.push_back(Cells(u, 20, rng));
    targets.AppendRow(std::vector<double>{u});
  }
  return SimulatedStatistic(samples, targets, Shape(), {.size = {.hidden = {8}, .filters = {4}}, .n_steps = 400},
                            RngKey(seed));
}

double Mean(SimulatedStatistic& statistic, const Array2<double>& rows) {
  const Array2<double> h = statistic.Of(rows);
  double mean = 0;
  for (int i = 0; i < h.rows(); ++i) mean += h(i, 0) / h.rows();
  return mean;
}

TEST(SimulatedStatistic, ItsMeanIsTheParameterOfSimulatorsItHasNotSeen) {
  SimulatedStatistic statistic = Learn();
  Rng rng(2);
  for (const double u : {0.2, 0.5, 0.8}) EXPECT_NEAR(Mean(statistic, Cells(u, 4000, rng)), u, 0.03) << u;
  // 180 cells of probability 1/2 fix u to 0.037; the statistic is not much worse.
  EXPECT_LT(statistic.error(), 0.06);
}

TEST(SimulatedStatistic, SameSeedSameBytesAndAFileGivesItBack) {
  SimulatedStatistic one = Learn(), two = Learn(), other = Learn(4);
  Rng rng(5);
  const Array2<double> rows = Cells(0.4, 300, rng);
  EXPECT_EQ(one.Of(rows), two.Of(rows));
  EXPECT_NE(one.Of(rows), other.Of(rows));
  NpzArrays arrays;
  one.Save(arrays);
  ASSERT_TRUE(SimulatedStatistic::IsIn(arrays));
  SimulatedStatistic read = SimulatedStatistic::Load(ParseNpz(NpzBytes(arrays), "memory"), "memory");
  EXPECT_EQ(read.Of(rows), one.Of(rows));
  arrays.erase("statistic/hidden");
  EXPECT_NE(MessageOf<DataError>([&] { SimulatedStatistic::Load(arrays, "d.npz"); }).find("statistic/hidden"),
            std::string::npos);
}

}  // namespace
}  // namespace oted
