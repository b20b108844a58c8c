#include "oted/collect/excitation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/collect/demonstrations.h"
#include "oted/sim/testing.h"

namespace oted::excitation_test {

using testing::HasSubstr;

SimulatorSpec Spec() {
  SimulatorSpec spec;
  spec.act_dim = 2;
  spec.action_low = {-2, 0};
  spec.action_high = {2, 10};
  spec.control_period_s = 0.02;
  return spec;
}

std::vector<double> Actions(const std::string& text, int n_steps, int which, uint64_t seed = 1) {
  const SimulatorSpec spec = Spec();
  OpenLoop actions(*Excitation::Parse(text), spec, RngKey(seed));
  std::vector<double> row(2), column;
  for (int i = 0; i < n_steps; ++i) {
    actions.Next(row);
    EXPECT_TRUE(-2 <= row[0] && row[0] <= 2 && 0 <= row[1] && row[1] <= 10) << text;
    column.push_back(row[static_cast<size_t>(which)]);
  }
  return column;
}

double Correlation(const std::vector<double>& x, double mean, size_t lag) {
  double product = 0, square = 0;
  for (size_t i = 0; i + lag < x.size(); ++i) {
    product += (x[i] - mean) * (x[i + lag] - mean);
    square += (x[i] - mean) * (x[i] - mean);
  }
  return product / square;
}

TEST(Excitation, OtherTextsAreNoExcitation) {
  EXPECT_FALSE(Excitation::Parse("policy.npz"));
  EXPECT_FALSE(Excitation::Parse("noise.npz"));
  EXPECT_FALSE(Excitation::Parse(""));
  EXPECT_EQ(Excitation::Parse("random")->kind, Excitation::Kind::kRandom);
  EXPECT_EQ(Excitation::Parse("noise:0.4:0.1")->amplitude, 0.4);
  EXPECT_EQ(Excitation::Parse("noise:0.4:0.1")->correlation_time, 0.1);
  EXPECT_EQ(Excitation::Parse("sine:0.7")->amplitude, 0.7);
}

TEST(Excitation, NumbersThatMakeNoSenseAreErrors) {
  for (const char* text : {"noise:x", "noise:-1", "noise:0.1:0", "sine:", "sine:1:2", "random:1", "noise:1:1:1"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { Excitation::Parse(text); }), HasSubstr(text)) << text;
  }
}

TEST(Excitation, NoiseHasTheStandardDeviationAndTheCorrelationTimeAskedFor) {
  const std::vector<double> x = Actions("noise:0.2:0.1", 100'000, 1);
  double mean = 0, square = 0;
  for (const double v : x) mean += v / static_cast<double>(x.size());
  for (const double v : x) square += (v - mean) * (v - mean) / static_cast<double>(x.size());
  EXPECT_NEAR(mean, 5, 0.05);
  EXPECT_NEAR(std::sqrt(square), 0.2 * 5, 0.03);
  // exp(-t / 0.1 s) after 1 and after 5 steps of 0.02 s.
  EXPECT_NEAR(Correlation(x, 5, 1), std::exp(-0.2), 0.02);
  EXPECT_NEAR(Correlation(x, 5, 5), std::exp(-1.0), 0.04);
}

TEST(Excitation, SinesAreSmoothAndReachNoFurtherThanTheirAmplitude) {
  const std::vector<double> x = Actions("sine:0.5", 5000, 0);
  const auto [low, high] = std::minmax_element(x.begin(), x.end());
  EXPECT_GE(*low, -1.0);
  EXPECT_LE(*high, 1.0);
  EXPECT_GT(*high - *low, 0.8);
  double step = 0;
  for (size_t i = 1; i < x.size(); ++i) step = std::max(step, std::abs(x[i] - x[i - 1]));
  // Amplitude 1 at the highest frequency, 50 Hz / 8: the slope is at most 2 pi f.
  EXPECT_LE(step, 2 * M_PI * 6.25 * 0.02);
}

TEST(Excitation, EveryActionAndEpisodeHasItsOwn) {
  for (const char* text : {"random", "noise:0.3", "sine"}) {
    EXPECT_EQ(Actions(text, 50, 0), Actions(text, 50, 0)) << text;
    EXPECT_NE(Actions(text, 50, 0, 1), Actions(text, 50, 0, 2)) << text;
    const std::vector<double> a = Actions(text, 50, 0), b = Actions(text, 50, 1);
    EXPECT_GT(std::abs(a[20] / 2 - (b[20] - 5) / 5), 1e-6) << text;
  }
}

TEST(CollectExcitation, LogsEpisodesOfTheTaskAtAnyNumberOfThreads) {
  const PointMassFactory factory(PointMassOptions{.max_episode_steps = 15});
  const Excitation excitation = *Excitation::Parse("noise:0.5");
  const Dataset one = CollectExcitation(factory, {1.5, 1, 0}, excitation, 6, RngKey(2), 1);
  const Dataset two = CollectExcitation(factory, {1.5, 1, 0}, excitation, 6, RngKey(2), 2);
  one.Check();
  EXPECT_EQ(one.Episodes().size(), 6u);
  EXPECT_EQ(one.size(), 90);
  EXPECT_EQ(one.observations, two.observations);
  EXPECT_EQ(one.actions, two.actions);
  for (int i = 0; i < one.size(); ++i) {
    EXPECT_NEAR(one.next_observations(i, 0), one.observations(i, 0) + 0.15 * one.actions(i, 0), 2e-7);
  }
  EXPECT_NE(one.actions(0, 0), one.actions(15, 0));
}

}  // namespace oted::excitation_test
