#include "oted/data/normalizer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/error.h"
#include "oted/base/rng.h"

namespace oted::normalizer_test {

TEST(Normalizer, FitsMeanAndStandardDeviation) {
  Array2<double> rows;
  for (const double x : {1.0, 3.0, 5.0, 7.0}) rows.AppendRow(std::vector<double>{x, 10 * x});
  const Normalizer fit = Normalizer::Fit(rows);
  EXPECT_DOUBLE_EQ(fit.mean[0], 4.0);
  EXPECT_DOUBLE_EQ(fit.mean[1], 40.0);
  EXPECT_DOUBLE_EQ(fit.scale[0], std::sqrt(5.0));
  EXPECT_DOUBLE_EQ(fit.scale[1], 10 * std::sqrt(5.0));
}

TEST(Normalizer, AppliedToItsOwnRowsGivesZeroMeanAndUnitVariance) {
  Rng rng(1);
  Array2<double> rows(2000, 3);
  for (int i = 0; i < rows.rows(); ++i) {
    for (int j = 0; j < 3; ++j) rows(i, j) = 100 * j + std::pow(10.0, j - 1) * rng.Normal();
  }
  const Normalizer fit = Normalizer::Fit(rows);
  std::vector<double> sum(3), sum_of_squares(3);
  std::vector<float> out(3);
  for (int i = 0; i < rows.rows(); ++i) {
    fit.Apply(rows.row(i), out);
    for (int j = 0; j < 3; ++j) sum[j] += out[j];
    for (int j = 0; j < 3; ++j) sum_of_squares[j] += out[j] * out[j];
  }
  for (int j = 0; j < 3; ++j) {
    EXPECT_NEAR(sum[j] / 2000, 0.0, 1e-5);
    EXPECT_NEAR(sum_of_squares[j] / 2000, 1.0, 1e-5);
  }
}

TEST(Normalizer, AConstantChannelDoesNotBlowUp) {
  Array2<double> rows;
  // 0.1 sums with rounding: its computed deviation is tiny but not zero.
  for (int i = 0; i < 1000; ++i) rows.AppendRow(std::vector<double>{0.1, i % 2 == 0 ? -1.0 : 1.0, 0.0});
  const Normalizer fit = Normalizer::Fit(rows);
  EXPECT_DOUBLE_EQ(fit.scale[0], 1e-3);
  EXPECT_DOUBLE_EQ(fit.scale[1], 1.0);
  EXPECT_DOUBLE_EQ(fit.scale[2], 1e-3);
}

TEST(Normalizer, AllConstantChannelsHaveUnitScale) {
  EXPECT_EQ(Normalizer::Fit(Array2<double>(5, 2, 0.1)).scale, (std::vector<double>{1.0, 1.0}));
}

TEST(Normalizer, ScalesWithTheUnits) {
  Array2<double> rows;
  Array2<double> scaled;
  for (int i = 0; i < 20; ++i) rows.AppendRow(std::vector<double>{i * 1.0, 5.0});
  for (int i = 0; i < 20; ++i) scaled.AppendRow(std::vector<double>{i * 1024.0, 5.0 * 1024});
  for (int j = 0; j < 2; ++j) {
    EXPECT_DOUBLE_EQ(Normalizer::Fit(scaled).scale[j], 1024 * Normalizer::Fit(rows).scale[j]);
  }
}

TEST(Normalizer, NoRowsAreRefused) { EXPECT_THROW(Normalizer::Fit(Array2<double>()), DataError); }

}  // namespace oted::normalizer_test
