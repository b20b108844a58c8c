#include "oted/rl/observation_statistics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::observation_statistics_test {

constexpr int kObsDim = 3, kActDim = 2;

/// Channels of different offset and spread; the last is constant.
Array2<double> Rows(int n) {
  Array2<double> rows;
  Rng rng(3);
  for (int i = 0; i < n; ++i) rows.AppendRow(std::vector<double>{1e5 + rng.Normal(), 1e-3 * rng.Normal(), 0.25});
  return rows;
}

TEST(ObservationStatistics, AreThoseOfAllRowsTogether) {
  const Array2<double> rows = Rows(501);
  ObservationStatistics statistics(kObsDim);
  statistics.Add(rows.row(0));
  statistics.Add(rows.values().subspan(kObsDim));  // the other 500 at once
  const Normalizer expected = Normalizer::Fit(rows);
  for (size_t j = 0; j < kObsDim; ++j) {
    EXPECT_NEAR(statistics.normalizer().mean[j], expected.mean[j], 1e-7 * std::abs(expected.mean[j]));
    EXPECT_NEAR(statistics.normalizer().scale[j], expected.scale[j], 1e-6 * expected.scale[j]);
  }
}

TEST(ObservationStatistics, BeforeTheFirstObservationChangeNothing) {
  const Normalizer normalizer = ObservationStatistics(kObsDim).normalizer();
  EXPECT_EQ(normalizer.mean, std::vector<double>(kObsDim, 0.0));
  EXPECT_EQ(normalizer.scale, std::vector<double>(kObsDim, 1.0));
}

TEST(ObservationStatistics, ABatchIsWhatThePolicysNormaliserMakesOfIt) {
  const Array2<double> rows = Rows(40);
  ObservationStatistics statistics(kObsDim);
  statistics.Add(rows.values());
  ReplayBuffer buffer(kObsDim, kActDim, 100);
  for (int i = 0; i + 1 < rows.rows(); ++i) {
    const double number = i;
    buffer.Add(rows.row(i), std::vector<double>{0.1, number}, number, rows.row(i + 1), 0.99);
  }
  TransitionBatch raw, batch;
  Rng rng(1), same(1);
  buffer.Sample(16, rng, raw);
  buffer.Sample(16, same, batch);
  statistics.Normalize(batch);

  for (size_t row = 0; row < 32; ++row) {
    const float* s = raw.observations.data() + row * kObsDim;
    float expected[kObsDim];
    statistics.normalizer().Apply(std::vector<double>(s, s + kObsDim), expected);
    for (size_t j = 0; j < kObsDim; ++j) {
      EXPECT_NEAR(batch.observations[row * kObsDim + j], expected[j], 1e-6 * std::max(1.0f, std::abs(expected[j])));
    }
  }
  for (size_t row = 0; row < 16; ++row) {
    const float* joint = batch.joint.data() + row * (kObsDim + kActDim);
    EXPECT_TRUE(std::equal(joint, joint + kObsDim, batch.observations.data() + row * kObsDim));
    EXPECT_TRUE(
        std::equal(joint + kObsDim, joint + kObsDim + kActDim, raw.joint.data() + row * (kObsDim + kActDim) + kObsDim))
        << "actions stay as they are";
  }
  EXPECT_EQ(batch.rewards, raw.rewards);
}

TEST(ObservationStatistics, GoOnFromACheckpoint) {
  const Array2<double> rows = Rows(30);
  ObservationStatistics whole(kObsDim), first(kObsDim), rest(kObsDim);
  whole.Add(rows.values());
  first.Add(rows.values().first(10 * kObsDim));
  NpzArrays arrays;
  first.Save(arrays);
  rest.Restore(arrays);
  rest.Add(rows.values().subspan(10 * kObsDim));
  EXPECT_EQ(rest.normalizer().mean, whole.normalizer().mean);
  EXPECT_EQ(rest.normalizer().scale, whole.normalizer().scale);
  arrays.erase("observations/squares");
  EXPECT_THAT(MessageOf<DataError>([&] { rest.Restore(arrays); }), testing::HasSubstr("observations/squares"));
}

}  // namespace oted::observation_statistics_test
