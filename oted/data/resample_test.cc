#include "oted/data/resample.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "oted/base/error.h"
#include "oted/base/rng.h"
#include "oted/base/testing.h"

namespace oted::resample_test {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Stream At(const std::string& name, const std::vector<double>& times, const std::function<double(double)>& value) {
  Stream stream{name, "/topic:" + name, times, {}};
  for (const double t : times) stream.values.push_back(value(t));
  return stream;
}

std::vector<double> Every(double step, double from, double to) {
  std::vector<double> times;
  for (int k = 0; from + k * step < to; ++k) times.push_back(from + k * step);
  return times;
}

double Line(double t) { return 3 * t - 1; }
/// What a controller that ticks every 0.1 s from `phase` on commands.
std::function<double(double)> Ticks(double phase) {
  return [phase](double t) { return std::floor((t - phase) / 0.1 + 1e-9); };
}

TEST(Resample, ChannelsOfOtherRatesAndJitterMeetOnOneGrid) {
  Rng rng = RngKey(1).MakeRng();
  std::vector<double> jittered = Every(0.002, 0, 2);
  for (double& t : jittered) t += rng.Uniform(-3e-4, 3e-4);
  const Recording r = FromStreams({At("q", jittered, Line), At("v", Every(0.007, -0.01, 2), Line)},
                                  {At("u", Every(0.1, -0.05, 2), Ticks(-0.05))}, 0.02);
  EXPECT_THAT(r.observation_names, ElementsAre("q", "v"));
  ASSERT_EQ(r.runs.size(), 1u);
  ASSERT_GT(r.observations.rows(), 90);
  const double start = (r.observations(0, 0) + 1) / 3;  // a line is met exactly
  for (int k = 0; k < r.observations.rows(); ++k) {
    const double t = start + 0.02 * k;
    EXPECT_NEAR(r.observations(k, 0), Line(t), 1e-9);
    EXPECT_NEAR(r.observations(k, 1), Line(t), 1e-9);
    EXPECT_EQ(r.actions(k, 0), std::floor((t + 0.05) / 0.1 + 1e-5)) << t;
  }
}

TEST(Resample, TheGridStartsOnTheControllersClock) {
  // Both clocks tick every 0.1 s, the controller's 0.03 s later: from its own moments on no action changes within a
  // period.
  const Recording r =
      FromStreams({At("q", Every(0.01, 0, 3), Line)}, {At("u", Every(0.1, -0.07, 3), Ticks(-0.07))}, 0.1);
  EXPECT_NEAR(r.observations(0, 0), Line(0.03), 1e-9);
  EXPECT_THAT(r.warnings, IsEmpty());
  // Twice as fast, half of the commands go unused, and this is said.
  const Recording fast = FromStreams({At("q", Every(0.01, 0, 3), Line)}, {At("u", Every(0.05, 0, 3), Line)}, 0.1);
  EXPECT_THAT(fast.warnings, ElementsAre(AllOf(HasSubstr("the action changed within"), HasSubstr("'u'"))));
}

TEST(Resample, AGapEndsAnEpisodeAndAnotherBeginsBehindItWithAGridOfItsOwn) {
  std::vector<double> times = Every(0.01, 0, 0.5);
  for (const double t : Every(0.01, 0.703, 1.2)) times.push_back(t);
  const Recording r = FromStreams({At("q", times, Line)}, {At("u", {-1, 5}, Line)}, 0.02);
  ASSERT_EQ(r.runs.size(), 2u);
  EXPECT_NEAR(r.observations(r.runs[1].begin, 0), Line(0.703), 1e-9);
  EXPECT_LE(r.observations(r.runs[0].end - 1, 0), Line(0.49) + 1e-9);
  EXPECT_THAT(r.warnings, ElementsAre(HasSubstr("1 gaps of more than 3.5 steps")));
  // Three missing samples are none where more are allowed.
  EXPECT_EQ(FromStreams({At("q", times, Line)}, {At("u", {-1, 5}, Line)}, 0.02, 50).runs.size(), 1u);
}

TEST(Resample, TimesSince1970LoseNothingThatMatters) {
  const double now = 1.7e9;
  const auto from = [&](double t) { return t - now; };
  const Recording r = FromStreams({At("q", Every(0.01, now, now + 1), from)}, {At("u", {now, now + 1}, from)}, 0.02);
  for (int k = 0; k < r.observations.rows(); ++k) EXPECT_NEAR(r.observations(k, 0), 0.02 * k, 1e-6);
}

TEST(Resample, AFewStampsMayRepeatAndManyMayNot) {
  std::vector<double> times = Every(0.01, 0, 5);
  times.insert(times.begin() + 20, times[19]);
  const Recording r = FromStreams({At("q", times, Line)}, {At("u", {0, 5}, Line)}, 0.02);
  EXPECT_THAT(r.warnings, ElementsAre(HasSubstr("1 samples whose times do not rise")));
  EXPECT_NEAR(r.observations(100, 0), Line(2), 1e-9);
  std::vector<double> twice;
  for (const double t : times) twice.insert(twice.end(), 2, t);
  const auto fails = [&](const Stream& q, double period) {
    return MessageOf<DataError>([&] { FromStreams({q}, {At("u", {0, 5}, Line)}, period); });
  };
  EXPECT_THAT(fails(At("q", twice, Line), 0.02), AllOf(HasSubstr("'q' (/topic:q)"), HasSubstr("do not rise")));
  EXPECT_THAT(fails(At("q", {0, 1, 2}, [](double t) { return std::log(t - 1); }), 1), HasSubstr("not finite"));
  EXPECT_THAT(fails(At("q", {0}, Line), 1), HasSubstr("has 1 samples"));
  EXPECT_THAT(fails(At("q", Every(0.01, 50, 60), Line), 0.001), HasSubstr("log faster"));
  EXPECT_THAT(fails(At("q", Every(0.01, -9, -8), Line), 0.02), HasSubstr("clocks"));
}

TEST(Resample, ASlowChannelBesideAFastOneIsInterpolatedAndSaidSo) {
  const Recording r = FromStreams({At("q", Every(0.01, 0, 2), Line), At("heat", Every(0.5, 0, 2.1), Line)},
                                  {At("u", {0, 5}, Line)}, 0.02);
  EXPECT_THAT(r.warnings, Contains(AllOf(HasSubstr("'heat'"), HasSubstr("interpolated"))));
  EXPECT_NEAR(r.observations(30, 1), Line(0.6), 1e-9);
}

TEST(Resample, ATableAndChannelsOfTheSameMomentsGiveTheSameRows) {
  // One log, said in two ways: the rules are one.
  Recording table;
  table.file = "log.csv";
  std::vector<double> times = Every(0.001, 0, 1);
  Stream q = At("q", times, [](double t) { return std::sin(7 * t); });
  Stream u = At("u", times, [](double t) { return std::floor((t - 0.003) / 0.008 + 1e-6); });
  for (size_t i = 0; i < times.size(); ++i) {
    table.observations.AppendRow(std::vector<double>{q.values[i]});
    table.actions.AppendRow(std::vector<double>{u.values[i]});
  }
  table.times = times;
  const int n = static_cast<int>(times.size());
  table.runs = {{0, n, false}};
  table.period_s = 0.001;
  table.observation_names = {"q"};
  table.action_names = {"u"};
  const Recording a = Resample(table, 0.008), b = FromStreams({q}, {u}, 0.008);
  ASSERT_EQ(a.observations.rows(), b.observations.rows());
  for (int k = 0; k < a.observations.rows(); ++k) {
    EXPECT_NEAR(a.observations(k, 0), b.observations(k, 0), 1e-12);
    if (k + 1 < a.observations.rows()) {
      EXPECT_EQ(a.actions(k, 0), b.actions(k, 0));
    }
  }
}

}  // namespace oted::resample_test
