#include "oted/stages/design/replay/local_rates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "oted/base/rng.h"

namespace oted::local_rates_test {

constexpr double kPeriod = 0.01;

/// Two episodes of 100 steps; the second begins where nothing joins the first.
Dataset Logs(int obs_dim, const std::function<double(int column, double t)>& reading, double noise = 0) {
  Dataset logs;
  Rng rng = RngKey(1).MakeRng();
  const auto row = [&](double t) {
    std::vector<double> values;
    for (int c = 0; c < obs_dim; ++c) values.push_back(reading(c, t) + noise * rng.Normal());
    return values;
  };
  for (const double begin : {0.0, 7.0}) {
    for (int k = 0; k < 100; ++k) {
      logs.observations.AppendRow(row(begin + k * kPeriod));
      logs.next_observations.AppendRow(row(begin + (k + 1) * kPeriod));
      logs.actions.AppendRow(std::vector<double>{0});
      logs.rewards.push_back(0);
      logs.terminals.push_back(0);
      logs.timeouts.push_back(k == 99);
    }
  }
  return logs;
}

TEST(LocalRates, OfAParabolaAreExactUpToTheEndsOfAnEpisode) {
  const Dataset logs = Logs(1, [](int, double t) { return 1 + 2 * t + 3 * t * t; });
  LocalRates rates(logs, kPeriod);
  for (const int row : {0, 1, 50, 99}) EXPECT_NEAR(rates.Rate(0, row), 2 + 6 * row * kPeriod, 1e-8) << row;
  EXPECT_NEAR(rates.Rate(0, 100), 2 + 6 * 7.0, 1e-8) << "the second episode's first row";
}

TEST(LocalRates, UnderNoiseFitMoreReadingsAndAreNearerThanDifferences) {
  const auto sine = [](int, double t) { return std::sin(6 * t); };
  const Dataset clean = Logs(1, sine), noisy = Logs(1, sine, 0.01);
  LocalRates of_clean(clean, kPeriod), of_noisy(noisy, kPeriod);
  EXPECT_GT(of_noisy.HalfWidth(0), of_clean.HalfWidth(0));
  double square = 0;
  for (int row = 20; row < 80; ++row) square += std::pow(of_noisy.Rate(0, row) - 6 * std::cos(6 * row * kPeriod), 2);
  EXPECT_LT(std::sqrt(square / 60), 0.3 * 0.01 / (std::sqrt(2.0) * kPeriod)) << "of a central difference";
}

TEST(LocalRates, TurnsAreInTheBodysFrameWhateverTheQuaternionsSign) {
  // About the axis (0.6, 0, 0.8), 3 rad/s; from the middle on the same orientations with the other sign.
  const auto part = [](int c, double t) {
    const double half = 1.5 * t, sign = t < 50.5 * kPeriod ? 1 : -1;
    const double axis[] = {0, 0.6, 0, 0.8};
    return sign * (c == 0 ? std::cos(half) : axis[c] * std::sin(half));
  };
  const Dataset logs = Logs(4, part);
  LocalRates rates(logs, kPeriod);
  EXPECT_NEAR(rates.TurnRate({0, 1, 2, 3}, 0, 50), 1.8, 1e-3);
  EXPECT_NEAR(rates.TurnRate({0, 1, 2, 3}, 1, 50), 0, 1e-3);
  EXPECT_NEAR(rates.TurnRate({0, 1, 2, 3}, 2, 50), 2.4, 1e-3);
}

}  // namespace oted::local_rates_test
