#include "oted/rl/replay_buffer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "oted/base/error.h"

namespace oted::replay_buffer_test {

/// Row `i`: every number names the row and its place.
void AddRow(ReplayBuffer& buffer, int i) {
  const std::vector<double> s = {i + 0.0, i + 0.1}, a = {i + 0.2}, s_next = {i + 0.3, i + 0.4};
  buffer.Add(s, a, i + 0.5, s_next, i + 0.6);
}

TEST(ReplayBuffer, ABatchIsLaidOutAsTheUpdateReadsIt) {
  ReplayBuffer buffer(2, 1, 10);
  for (int i = 0; i < 4; ++i) AddRow(buffer, i);
  TransitionBatch batch;
  Rng rng(1);
  buffer.Sample(50, rng, batch);
  ASSERT_EQ(batch.size, 50);
  ASSERT_EQ(batch.observations.size(), 200u);
  ASSERT_EQ(batch.joint.size(), 150u);
  ASSERT_EQ(batch.noise.size(), 100u);
  for (size_t b = 0; b < 50; ++b) {
    const float i = batch.observations[2 * b];
    EXPECT_EQ(batch.observations[2 * b + 1], static_cast<float>(i + 0.1));
    EXPECT_EQ(batch.observations[100 + 2 * b], static_cast<float>(i + 0.3));
    EXPECT_EQ(batch.observations[100 + 2 * b + 1], static_cast<float>(i + 0.4));
    EXPECT_EQ(batch.joint[3 * b], i);
    EXPECT_EQ(batch.joint[3 * b + 1], static_cast<float>(i + 0.1));
    EXPECT_EQ(batch.joint[3 * b + 2], static_cast<float>(i + 0.2));
    EXPECT_EQ(batch.rewards[b], static_cast<float>(i + 0.5));
    EXPECT_EQ(batch.discounts[b], static_cast<float>(i + 0.6));
  }
}

TEST(ReplayBuffer, AFullRingKeepsTheLastRows) {
  ReplayBuffer buffer(2, 1, 5);
  for (int i = 0; i < 12; ++i) {
    AddRow(buffer, i);
    EXPECT_EQ(buffer.size(), std::min(i + 1, 5));
  }
  EXPECT_EQ(buffer.next(), 2);
  TransitionBatch batch;
  Rng rng(2);
  buffer.Sample(300, rng, batch);
  std::set<float> seen;
  for (size_t b = 0; b < 300; ++b) seen.insert(batch.observations[2 * b]);
  EXPECT_EQ(seen, (std::set<float>{7, 8, 9, 10, 11}));
}

TEST(ReplayBuffer, RowsAreDrawnUniformlyAndNoiseIsStandardNormal) {
  ReplayBuffer buffer(2, 1, 100);
  for (int i = 0; i < 20; ++i) AddRow(buffer, i);
  TransitionBatch batch;
  Rng rng(3);
  std::vector<double> counts(20, 0);
  double noise_sum = 0, noise_squares = 0, n_noise = 0;
  for (int repeat = 0; repeat < 100; ++repeat) {
    buffer.Sample(200, rng, batch);
    for (size_t b = 0; b < 200; ++b) ++counts[static_cast<size_t>(batch.observations[2 * b])];
    for (const float v : batch.noise) {
      noise_sum += v;
      noise_squares += v * v;
      ++n_noise;
    }
  }
  double chi_squared = 0;
  for (const double count : counts) chi_squared += (count - 1000) * (count - 1000) / 1000;
  EXPECT_LT(chi_squared, 43.8);  // 99.9 % of chi squared with 19 degrees of freedom
  EXPECT_NEAR(noise_sum / n_noise, 0, 5 / std::sqrt(n_noise));
  EXPECT_NEAR(noise_squares / n_noise, 1, 5 * std::sqrt(2 / n_noise));
}

TEST(ReplayBuffer, ARestoredBufferDrawsAndOverwritesTheSame) {
  for (const int n_rows : {3, 5, 8}) {  // below, at and beyond the capacity
    ReplayBuffer buffer(2, 1, 5), restored(2, 1, 5);
    for (int i = 0; i < n_rows; ++i) AddRow(buffer, i);
    restored.Restore(buffer.rows(), buffer.next());
    Rng rng_a(4), rng_b(4);
    TransitionBatch a, b;
    for (int i = 100; i < 107; ++i) {
      buffer.Sample(16, rng_a, a);
      restored.Sample(16, rng_b, b);
      EXPECT_EQ(a.observations, b.observations);
      EXPECT_EQ(a.joint, b.joint);
      EXPECT_EQ(a.rewards, b.rewards);
      EXPECT_EQ(a.discounts, b.discounts);
      EXPECT_EQ(a.noise, b.noise);
      AddRow(buffer, i);
      AddRow(restored, i);
    }
  }
}

TEST(ReplayBuffer, AnEmptyBufferHasNothingToDraw) {
  ReplayBuffer buffer(2, 1, 5);
  TransitionBatch batch;
  Rng rng(5);
  EXPECT_THROW(buffer.Sample(1, rng, batch), InternalError);
}

}  // namespace oted::replay_buffer_test
