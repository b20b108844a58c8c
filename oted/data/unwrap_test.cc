#include "oted/data/unwrap.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/data/dataset_files.h"

namespace oted::unwrap_test {

using testing::Contains;
using testing::HasSubstr;

constexpr double kTurn = 2 * std::numbers::pi;

double Wrapped(double angle) { return std::remainder(angle, kTurn); }
/// Two turns one way and three back, at most 0.3 rad in 0.02 s.
double Hinge(double t) { return 12 * std::sin(t) - 3 * t; }

std::vector<double> Unwrapped(std::vector<double> values) {
  Unwrapper unwrap;
  for (double& value : values) value = unwrap(value);
  return values;
}

TEST(Unwrap, AnAngleGoesOnFromItsFirstValueWithinHalfATurn) {
  std::vector<double> truth, logged;
  for (int i = 0; i < 400; ++i) {
    truth.push_back(Hinge(0.02 * i) + 1);
    logged.push_back(Wrapped(truth.back()));
  }
  const std::vector<double> found = Unwrapped(logged);
  for (size_t i = 0; i < truth.size(); ++i) EXPECT_NEAR(found[i], truth[i], 1e-12);
  for (size_t i = 1; i < found.size(); ++i) EXPECT_LE(std::abs(found[i] - found[i - 1]), kTurn / 2);
  // From 0 to 2 pi as well, whole turns away from the truth.
  for (double& value : logged) value = value < 0 ? value + kTurn : value;
  const std::vector<double> positive = Unwrapped(logged);
  for (size_t i = 0; i < truth.size(); ++i) EXPECT_NEAR(positive[i] - truth[i], positive[0] - truth[0], 1e-9);
}

TEST(Unwrap, WhatDoesNotWrapKeepsItsBits) {
  std::vector<double> values;
  for (int i = 0; i < 100; ++i) values.push_back(40.1 + std::sin(0.1 * i));
  EXPECT_EQ(Unwrapped(values), values);
  const double gap = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> found = Unwrapped({3.1, gap, -3.1});
  EXPECT_TRUE(std::isnan(found[1]));
  EXPECT_DOUBLE_EQ(found[2], -3.1 + kTurn);
}

class UnwrapFiles : public testing::Test {
 protected:
  /// Two episodes of a hinge at uneven moments, and of an arm that tells the time.
  std::string Csv(const char* hinge) const {
    std::string text = fmt::format("episode,time,{},joint/arm/qpos,act_0\n", hinge);
    for (int e = 0; e < 2; ++e) {
      for (int i = 0; i < 800; ++i) {
        const double t = 0.005 * i + 0.001 * (i % 2);
        text += fmt::format("{},{},{},{},{}\n", e, t, Wrapped(Hinge(t) + e), 0.1 * t, i);
      }
    }
    return text;
  }
  TestFolder folder_;
};

TEST_F(UnwrapFiles, RowsBetweenTwoSamplesLieOnTheAngleAndNotBetweenItsEnds) {
  WriteFileAtomically(folder_ / "log.csv", Csv("joint/hinge/qpos"));
  DataOptions options;
  options.control_period_s = 0.02;
  options.columns.observations = {"joint/hinge/qpos", "joint/arm/qpos"};
  options.unwrap = {"joint/h*/qpos"};
  const Dataset d = ReadDataset(folder_ / "log.csv", options);
  EXPECT_THAT(d.remarks, Contains(HasSubstr("jumps of 'joint/hinge/qpos' by a whole turn taken out")));
  const std::vector<Episode> episodes = d.Episodes();
  ASSERT_EQ(episodes.size(), 2u);
  for (int e = 0; e < 2; ++e) {
    for (int i = episodes[e].begin; i < episodes[e].end; ++i) {
      const double t = d.observations(i, 1) / 0.1;  // which is linear, so it tells the time
      EXPECT_NEAR(d.observations(i, 0), Hinge(t) + e, 1e-4) << "linear over 6 ms: h^2 / 8 of 12 rad/s^2";
      EXPECT_NEAR(d.next_observations(i, 0), Hinge(d.next_observations(i, 1) / 0.1) + e, 1e-4);
    }
  }
}

TEST_F(UnwrapFiles, ATaskNamesTheColumnsThatALogCallsByPlaceAndAnUnknownNameIsRefused) {
  WriteFileAtomically(folder_ / "log.csv", Csv("obs_0"));
  DataOptions options;
  options.columns.observations = {"obs_0", "joint/arm/qpos"};
  options.unwrap = {"joint/hinge/qpos"};
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadDataset(folder_ / "log.csv", options); }),
              HasSubstr("has no observation 'joint/hinge/qpos'; it has obs_0, joint/arm/qpos"));
  options.observation_names = {"joint/hinge/qpos", "joint/knee/qpos"};
  EXPECT_NEAR(ReadDataset(folder_ / "log.csv", options).observations(500, 0), Hinge(2.5), 0.1);
}

TEST_F(UnwrapFiles, ArraysAreUnwrappedEpisodeByEpisode) {
  Dataset log;
  for (int e = 0; e < 2; ++e) {
    for (int i = 0; i < 300; ++i) {
      log.observations.AppendRow(std::vector<double>{Wrapped(Hinge(0.02 * i) + e)});
      log.next_observations.AppendRow(std::vector<double>{Wrapped(Hinge(0.02 * (i + 1)) + e)});
      log.actions.AppendRow(std::vector<double>{0.0});
      log.terminals.push_back(0);
      log.timeouts.push_back(i == 299);
    }
  }
  WriteDataset(log, folder_ / "log.npz");
  DataOptions options;
  options.observation_names = options.unwrap = {"hinge"};
  const Dataset d = ReadDataset(folder_ / "log.npz", options);
  for (int row = 0; row < d.size(); ++row) {
    EXPECT_NEAR(d.observations(row, 0), Hinge(0.02 * (row % 300)) + row / 300, 1e-9);
    EXPECT_NEAR(d.next_observations(row, 0), Hinge(0.02 * (row % 300 + 1)) + row / 300, 1e-9);
  }
  log.qpos = log.qvel = log.observations;
  WriteDataset(log, folder_ / "state.npz");
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadDataset(folder_ / "state.npz", options); }),
              HasSubstr("also holds qpos"));
}

TEST(Unwrap, ChannelsAreUnwrappedBeforeTheyMeetOnAGrid) {
  Stream hinge{"hinge", "", {}, {}}, command{"u", "", {0, 9}, {0, 0}};
  for (int i = 0; i < 900; ++i) {
    hinge.times.push_back(0.007 * i);
    hinge.values.push_back(Wrapped(Hinge(0.007 * i)));
  }
  std::vector<Stream> states = {hinge};
  EXPECT_THAT(Unwrap(states, {"h*"}), Contains(HasSubstr("'hinge'")));
  const Recording rows = FromStreams(states, {command}, 0.02);
  for (int k = 0; k < rows.observations.rows(); ++k) {
    EXPECT_NEAR(rows.observations(k, 0), Hinge(0.02 * k), 1e-4);
  }
  EXPECT_THROW(Unwrap(states, {"elbow"}), UsageError);
}

}  // namespace oted::unwrap_test
