#include "oted/base/rng.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace oted::rng_test {

constexpr int kDraws = 200000;
// Five standard errors: a right generator fails once in 1.7 million seeds, and the seeds here are fixed.
constexpr double kErrors = 5.0;

struct Moments {
  double mean = 0;
  double variance = 0;
};

template <class Draw>
Moments MomentsOf(const Draw& draw) {
  double sum = 0;
  double sum_of_squares = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = draw();
    sum += x;
    sum_of_squares += x * x;
  }
  const double mean = sum / kDraws;
  return {mean, sum_of_squares / kDraws - mean * mean};
}

/// Compares with the analytic mean, variance and fourth central moment.
void ExpectMoments(const Moments& got, double mean, double variance, double fourth) {
  EXPECT_NEAR(got.mean, mean, kErrors * std::sqrt(variance / kDraws));
  EXPECT_NEAR(got.variance, variance, kErrors * std::sqrt((fourth - variance * variance) / kDraws));
}

std::vector<uint64_t> FirstWords(Rng rng) {
  std::vector<uint64_t> words(16);
  for (uint64_t& word : words) word = rng.Next();
  return words;
}

TEST(Rng, MatchesTheReferenceStreamOfXoshiro256PlusPlus) {
  Rng rng(0);
  rng.set_state({1, 2, 3, 4});
  // Worked by hand from the definition: rotl(s0 + s3, 23) + s0 is (5 << 23) + 1 first; the state is then
  // {7, 0, 262146, 6 << 45}, so that the second word is rotl(7 + (6 << 45), 23) + 7.
  EXPECT_EQ(rng.Next(), (uint64_t{5} << 23) + 1);
  EXPECT_EQ(rng.state(), (Rng::State{7, 0, 262146, uint64_t{6} << 45}));
  EXPECT_EQ(rng.Next(), (uint64_t{7} << 23) + (uint64_t{6} << 4) + 7);
}

TEST(Rng, EqualSeedsGiveEqualStreamsAndOthersDiffer) {
  EXPECT_EQ(FirstWords(Rng(7)), FirstWords(Rng(7)));
  EXPECT_NE(FirstWords(Rng(7)), FirstWords(Rng(8)));
  // The all-zero state would give zeros for ever.
  EXPECT_NE(FirstWords(Rng(0)), std::vector<uint64_t>(16, 0));
}

TEST(Rng, ACopyAndARestoredStateContinueTheSameStream) {
  Rng rng(3);
  rng.Normal();
  Rng restored(99);
  restored.set_state(rng.state());
  EXPECT_EQ(FirstWords(restored), FirstWords(rng));
}

TEST(Rng, UniformHasTheMomentsOfTheUnitInterval) {
  Rng rng(1);
  ExpectMoments(MomentsOf([&] { return rng.Uniform(); }), 0.5, 1.0 / 12, 1.0 / 80);
  for (int i = 0; i < kDraws; ++i) {
    const double x = rng.Uniform(-2.0, 3.0);
    ASSERT_TRUE(-2.0 <= x && x < 3.0);
  }
}

TEST(Rng, NormalHasTheMomentsOfTheStandardNormal) {
  Rng rng(2);
  ExpectMoments(MomentsOf([&] { return rng.Normal(); }), 0.0, 1.0, 3.0);
  int beyond = 0;
  for (int i = 0; i < kDraws; ++i) beyond += std::abs(rng.Normal()) > 1.959963984540054;
  EXPECT_NEAR(beyond / static_cast<double>(kDraws), 0.05, kErrors * std::sqrt(0.05 * 0.95 / kDraws));
}

TEST(Rng, FillNormalGivesIndependentStandardNormals) {
  Rng rng(4);
  for (const size_t n : {size_t{kDraws}, size_t{kDraws} - 1}) {
    std::vector<float> values(n + 1, 99.0f);
    rng.FillNormal({values.data(), n});
    EXPECT_EQ(values[n], 99.0f) << "wrote beyond the end";
    double sum = 0, squares = 0, pairs = 0;
    for (size_t i = 0; i < n; ++i) sum += values[i];
    for (size_t i = 0; i < n; ++i) squares += values[i] * values[i];
    for (size_t i = 0; i + 1 < n; i += 2) pairs += values[i] * values[i + 1];
    EXPECT_NEAR(sum / n, 0.0, kErrors / std::sqrt(n));
    EXPECT_NEAR(squares / n, 1.0, kErrors * std::sqrt(2.0 / n));
    EXPECT_NEAR(pairs / (n / 2), 0.0, kErrors / std::sqrt(n / 2));
  }
}

TEST(Rng, BelowIsUniformOverItsRange) {
  Rng rng(5);
  std::vector<int> counts(7, 0);
  for (int i = 0; i < kDraws; ++i) {
    const uint64_t k = rng.Below(7);
    ASSERT_LT(k, 7u);
    ++counts[k];
  }
  const double expected = kDraws / 7.0;
  for (const int count : counts) EXPECT_NEAR(count, expected, kErrors * std::sqrt(expected * 6 / 7));
  EXPECT_EQ(rng.Below(1), 0u);
}

TEST(RngKey, StreamsAreNamedByTheirWholePath) {
  const RngKey root(1);
  EXPECT_EQ(root.Stage("design").Index(3).value(), RngKey(1).Stage("design").Index(3).value());
  std::set<uint64_t> values;
  for (const uint64_t seed : {1, 2}) {
    for (const char* stage : {"", "design", "desigm", "clone"}) {
      values.insert(RngKey(seed).Stage(stage).value());
      for (uint64_t i = 0; i < 100; ++i) values.insert(RngKey(seed).Stage(stage).Index(i).value());
      for (uint64_t i = 0; i < 100; ++i) values.insert(RngKey(seed).Index(i).Stage(stage).value());
    }
  }
  EXPECT_EQ(values.size(), 2u * 4 * 201) << "two names share a stream";
}

TEST(RngKey, NeighbouringStreamsAreUncorrelated) {
  double sum = 0;
  for (uint64_t i = 0; i < kDraws; ++i) {
    Rng a = RngKey(1).Index(i).MakeRng();
    Rng b = RngKey(1).Index(i + 1).MakeRng();
    sum += (a.Uniform() - 0.5) * (b.Uniform() - 0.5);
  }
  EXPECT_NEAR(sum / kDraws, 0.0, kErrors / 12 / std::sqrt(kDraws));
}

TEST(RandomPermutation, HoldsEveryIndexOnceAndEveryOrderEquallyOften) {
  Rng rng(6);
  std::vector<int> order = RandomPermutation(1000, rng);
  EXPECT_FALSE(std::is_sorted(order.begin(), order.end()));
  std::sort(order.begin(), order.end());
  for (int i = 0; i < 1000; ++i) ASSERT_EQ(order[i], i);
  EXPECT_TRUE(RandomPermutation(0, rng).empty());

  const int trials = 60000;
  std::vector<int> counts(27, 0);
  for (int i = 0; i < trials; ++i) {
    const std::vector<int> p = RandomPermutation(3, rng);
    ++counts[9 * p[0] + 3 * p[1] + p[2]];
  }
  int orders = 0;
  for (const int count : counts) {
    if (count == 0) continue;
    ++orders;
    EXPECT_NEAR(count, trials / 6.0, kErrors * std::sqrt(trials / 6.0 * 5 / 6));
  }
  EXPECT_EQ(orders, 6);
}

}  // namespace oted::rng_test
