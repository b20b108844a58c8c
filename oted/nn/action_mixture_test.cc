#include "oted/nn/action_mixture.h"

#include <gtest/gtest.h>

#include <cmath>

namespace oted::action_mixture_test {

ActionMixture Example() {
  return {{0.3, -1.2, 0.8, 0.1, -0.4}, {-1.5, -0.3, 0.2, 0.9, 2.1}, {-0.7, -1.6, -0.2, -1.1, 0.4}};
}

/// All of a mixture's numbers in a row.
std::vector<double*> Numbers(ActionMixture& mixture) {
  std::vector<double*> numbers;
  for (auto* values : {&mixture.logits, &mixture.means, &mixture.log_stds}) {
    for (double& v : *values) numbers.push_back(&v);
  }
  return numbers;
}

TEST(ActionMixture, TheDensityIntegratesToOne) {
  const ActionMixture mixture = Example();
  double sum = 0;
  constexpr int kSteps = 200'000;
  for (int i = 0; i < kSteps; ++i)
    sum += std::exp(LogDensity(mixture, -1 + (2 * i + 1.0) / kSteps, nullptr)) * 2 / kSteps;
  EXPECT_NEAR(sum, 1, 1e-3);
}

TEST(ActionMixture, DrawsHaveItsDensity) {
  const ActionMixture mixture = Example();
  Rng rng(3);
  constexpr int kDraws = 200'000;
  int below = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double uniform = rng.Uniform();
    below += Draw(mixture, uniform, rng.Normal()).action < 0.25;
  }
  double expected = 0;
  for (int i = 0; i < 100'000; ++i)
    expected += std::exp(LogDensity(mixture, -1 + 1.25e-5 * (i + 0.5), nullptr)) * 1.25e-5;
  EXPECT_NEAR(static_cast<double>(below) / kDraws, expected, 0.005);
}

TEST(ActionMixture, GradientsAreDifferences) {
  constexpr double kStep = 1e-6;
  for (const double action : {-0.93, -0.1, 0.4, 0.999}) {
    ActionMixture mixture = Example();
    ActionMixtureGradient gradient;
    LogDensity(mixture, action, &gradient);
    const double slope =
        (LogDensity(mixture, action + kStep * 0.1, nullptr) - LogDensity(mixture, action - kStep * 0.1, nullptr)) /
        (0.2 * kStep);
    EXPECT_NEAR(gradient.action, slope, 1e-4 * (1 + std::abs(slope)));
    const auto own = Numbers(gradient), at = Numbers(mixture);
    for (size_t k = 0; k < at.size(); ++k) {
      const double value = *at[k];
      *at[k] = value + kStep;
      const double above = LogDensity(mixture, action, nullptr);
      *at[k] = value - kStep;
      EXPECT_NEAR(*own[k], (above - LogDensity(mixture, action, nullptr)) / (2 * kStep), 1e-6) << k;
      *at[k] = value;
    }
  }
}

TEST(ActionMixture, ADrawMovesWithItsComponentAlone) {
  constexpr double kStep = 1e-6, kNoise = 0.7;
  for (const double uniform : {0.05, 0.5, 0.99}) {
    ActionMixture mixture = Example();
    const MixtureDraw draw = Draw(mixture, uniform, kNoise);
    ActionMixtureGradient gradient;
    EXPECT_NEAR(LogDensityOfDraw(mixture, draw, kNoise, &gradient), LogDensity(mixture, draw.action, nullptr), 1e-9);
    const auto own = Numbers(gradient), at = Numbers(mixture);
    for (size_t k = 0; k < at.size(); ++k) {
      const double value = *at[k];
      const auto density = [&](double moved) {
        *at[k] = moved;
        // The same component: the draw is made anew with its mean and deviation.
        const size_t c = static_cast<size_t>(draw.component);
        const double u = mixture.means[c] + std::exp(mixture.log_stds[c]) * kNoise;
        return LogDensity(mixture, std::tanh(u), nullptr);
      };
      const double difference = (density(value + kStep) - density(value - kStep)) / (2 * kStep);
      *at[k] = value;
      EXPECT_NEAR(*own[k], difference, 1e-6) << k;
    }
  }
}

TEST(ActionMixture, ClippedActionsAndClampedDeviationsHaveNoSlope) {
  ActionMixture mixture = Example();
  mixture.log_stds[2] = 3;
  ActionMixtureGradient gradient;
  const double at_bound = LogDensity(mixture, 1, &gradient);
  EXPECT_EQ(gradient.action, 0);
  EXPECT_EQ(gradient.log_stds[2], 0);
  EXPECT_NE(gradient.log_stds[1], 0);
  EXPECT_EQ(at_bound, LogDensity(mixture, 1 - kMixtureMargin, nullptr));
}

}  // namespace oted::action_mixture_test
