#include "oted/stages/design/replay/held_out_replay.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oted/base/statistics.h"
#include "oted/data/sensor_noise.h"
#include "oted/matching/testing.h"

namespace oted::held_out_replay_test {

const std::vector<double> kTruth = {1.5, 0.6, 0.5};

HeldOutErrors Errors(const Dataset& logs, const std::vector<std::vector<double>>& z, double noise, int n_threads = 1,
                     const PointMassOptions& options = {}) {
  FitEvidence fit;
  fit.short_noise_std = {noise, noise};
  fit.scale = {0, 0};
  return ReplayHeldOut(PointMassFactory(options), logs, z, fit, n_threads);
}

double RootMeanSquare(const std::vector<double>& errors) {
  double sum = 0;
  for (const double error : errors) sum += error * error;
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

TEST(ReplayHeldOut, TheLogsOwnSimulatorLeavesTheNoiseAndOthersMore) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 40), 0.05, RngKey(3));
  const HeldOutErrors errors = Errors(logs, {kTruth, {1.4, 0.6, 0.5}, {1.0, 0.6, 0.5}}, 0.05);
  EXPECT_EQ(errors.n_steps, 10);
  ASSERT_GT(errors.n_windows, 40);
  EXPECT_NEAR(RootMeanSquare(errors.of[0]), 1, 0.05);
  EXPECT_GT(RootMeanSquare(errors.of[1]), 1.05 * RootMeanSquare(errors.of[0]));
  EXPECT_GT(RootMeanSquare(errors.of[2]), 1.5 * RootMeanSquare(errors.of[1]));
}

TEST(ReplayHeldOut, NoiseDoesNotFavourASimulatorThatForgetsItsStart) {
  // With noisy readings as starts the best damping would be too high: less of a start's error survives.
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 40), 0.2, RngKey(4));
  std::vector<std::vector<double>> z;
  for (const double damping : {0.4, 0.5, 0.6, 0.7, 0.8}) z.push_back({1.5, damping, 0.5});
  const HeldOutErrors errors = Errors(logs, z, 0.2);
  for (const size_t other : {0u, 1u, 3u, 4u}) {
    EXPECT_LT(RootMeanSquare(errors.of[2]), RootMeanSquare(errors.of[other])) << z[other][1];
  }
}

TEST(ReplayHeldOut, OnCleanLogsErrorsAreInHundredthsOfTheSpread) {
  const Dataset logs = PointMassLogs(kTruth, 8);
  const FitEvidence clean{.window = 2,
                          .explained = 1,
                          .noise_std = {},
                          .scale = {1, 2},
                          .short_noise_std = {1e-9, 1e-9},
                          .long_noise_std = {}};
  FitEvidence wider = clean;
  wider.scale = {10, 20};
  const std::vector<std::vector<double>> z = {{1.4, 0.6, 0.5}};
  const HeldOutErrors errors = ReplayHeldOut(PointMassFactory(), logs, z, clean, 1);
  const HeldOutErrors of_wider = ReplayHeldOut(PointMassFactory(), logs, z, wider, 1);
  EXPECT_GT(RootMeanSquare(errors.of[0]), 1) << "a gain that is off by a fifteenth is seen";
  EXPECT_LT(RootMeanSquare(errors.of[0]), 100);
  EXPECT_NEAR(RootMeanSquare(errors.of[0]) / RootMeanSquare(of_wider.of[0]), 10, 1e-9);
}

TEST(ReplayHeldOut, APhysicsThatBreaksDownIsTheWorstErrorAndNotMissing) {
  const Dataset logs = PointMassLogs(kTruth, 4);
  const HeldOutErrors errors = Errors(logs, {kTruth}, 0.01, 1, {.diverge_beyond = 0});
  ASSERT_GT(errors.n_windows, 0);
  for (const double error : errors.of[0]) EXPECT_EQ(error, kBrokenDownError);
}

TEST(ReplayHeldOut, WhereNoStateCanBeSetNothingIsCompared) {
  EXPECT_EQ(Errors(PointMassLogs(kTruth, 4), {kTruth}, 0.01, 1, {.velocity_clip = 0}).n_windows, 0);
}

TEST(ReplayHeldOut, GivesTheSameBytesAtAnyThreadCount) {
  const Dataset logs = WithSensorNoise(PointMassLogs(kTruth, 8), 0.05, RngKey(5));
  EXPECT_EQ(Errors(logs, {kTruth}, 0.05, 1).of, Errors(logs, {kTruth}, 0.05, 2).of);
}

}  // namespace oted::held_out_replay_test
