#include "oted/sim/channels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "oted/sim/channel_factory.h"
#include "oted/sim/known_constants.h"
#include "oted/sim/testing.h"
#include "tests/conformance/simulator_conformance.h"

namespace oted::channels_test {

using testing::ElementsAreArray;

ParameterSpec Channel(const std::string& name, const std::string& path, double low, double high) {
  return {.name = name, .field = path, .low = low, .high = high, .scale = ParameterScale::kAbsolute};
}
ParameterSpec ScaleOf(const std::string& path) { return {.name = "scale", .field = path, .low = 0.5, .high = 2}; }

/// The point mass with its own three parameters and, behind them, channels.
std::unique_ptr<ChannelSimulatorFactory> Factory(const std::vector<ParameterSpec>& channels,
                                                 const PointMassOptions& options = {}) {
  std::vector<ParameterSpec> specs = PointMass::MakeParameters().specs();
  specs.insert(specs.end(), channels.begin(), channels.end());
  return std::make_unique<ChannelSimulatorFactory>(
      specs, [=](const std::vector<ParameterSpec>&) { return std::make_unique<PointMassFactory>(options); });
}

std::vector<ParameterSpec> AllChannels() {
  return {Channel("delay", "action/delay", 0, 2.5), Channel("noise", "obs/*/noise_std", 0, 0.2),
          Channel("bias", "obs/v/bias", -0.5, 0.5), Channel("lag", "obs/x/delay", 0, 3), ScaleOf("obs/v/scale")};
}

/// Channels whose bias differs between recordings.
std::unique_ptr<SimulatorFactory> WithKnownBias() {
  return WithConstants(PointMass::MakeParameters().specs(), {Channel("zero", "obs/x/bias", -1, 1)},
                       [](const std::vector<ParameterSpec>& all) { return Factory({all.back()}); });
}

INSTANTIATE_TEST_SUITE_P(Channels, SimulatorConformance,
                         testing::Values(ConformanceCase{"None", [] { return Factory({}); }},
                                         ConformanceCase{"All", [] { return Factory(AllChannels()); }},
                                         ConformanceCase{"KnownConstants", [] { return WithKnownBias(); }}),
                         [](const auto& parameter) { return parameter.param.name; });

constexpr int kLane = 0;
double ActionAt(int step) { return std::sin(1.0 + 2.7 * step); }

/// One lane of the point mass (damping 0.4) behind channels at the values `channels`.
class OneLane {
 public:
  OneLane(const std::vector<ParameterSpec>& specs, const std::vector<double>& channels,
          const PointMassOptions& options = {})
      : factory_(Factory(specs, options)), simulator_(factory_->Make(1, 1)) {
    std::vector<double> z = {1, 0.4, 0.5};
    z.insert(z.end(), channels.begin(), channels.end());
    simulator_->SetParameters(kLane, z);
    Rng rng(1);
    simulator_->Reset(kLane, rng);
  }
  void Step(double action) { simulator_->Step({&kLane, 1}, {&action, 1}); }
  std::vector<double> Shown() const {
    return {simulator_->observation(kLane).begin(), simulator_->observation(kLane).end()};
  }
  Simulator& operator*() { return *simulator_; }

 private:
  std::unique_ptr<ChannelSimulatorFactory> factory_;
  std::unique_ptr<Simulator> simulator_;
};

/// What the bare plant shows: row k after k of `actions`.
std::vector<std::vector<double>> Plant(const std::vector<double>& actions) {
  OneLane plant({}, {});
  std::vector<std::vector<double>> rows = {plant.Shown()};
  for (const double a : actions) {
    plant.Step(a);
    rows.push_back(plant.Shown());
  }
  return rows;
}

TEST(ChannelSimulator, WithoutChannelsIsThePlantToTheLastBit) {
  const std::unique_ptr<Simulator> bare = PointMassFactory().Make(1, 1), wrapped = Factory({})->Make(1, 1);
  Rng of_bare(3), of_wrapped(3);
  bare->Reset(kLane, of_bare);
  wrapped->Reset(kLane, of_wrapped);
  EXPECT_EQ(of_bare.Next(), of_wrapped.Next()) << "no draw of its own";
  for (int step = 0; step < 25; ++step) {
    const double action = ActionAt(step);
    if (step == 12) {
      ASSERT_TRUE(bare->SetStateFromObservation(kLane, std::vector<double>{0.3, -0.2}));
      ASSERT_TRUE(wrapped->SetStateFromObservation(kLane, std::vector<double>{0.3, -0.2}));
    }
    bare->Step({&kLane, 1}, {&action, 1});
    wrapped->Step({&kLane, 1}, {&action, 1});
    EXPECT_THAT(wrapped->observation(kLane), ElementsAreArray(bare->observation(kLane)));
    EXPECT_EQ(wrapped->reward(kLane), bare->reward(kLane));
    EXPECT_EQ(wrapped->status(kLane), bare->status(kLane));
  }
}

TEST(ChannelSimulator, AWholeActionDelayIsThePlantWithItsActionsShifted) {
  for (const int delay : {0, 1, 3}) {
    OneLane delayed({Channel("delay", "action/delay", 0, 3)}, {static_cast<double>(delay)});
    std::vector<double> shifted(static_cast<size_t>(delay), 0.0);
    for (int step = 0; step < 12; ++step) shifted.push_back(ActionAt(step));
    const auto expected = Plant(shifted);
    for (int step = 0; step < 12; ++step) {
      delayed.Step(ActionAt(step));
      EXPECT_EQ(delayed.Shown(), expected[static_cast<size_t>(step) + 1]) << delay << " at " << step;
    }
  }
}

TEST(ChannelSimulator, AFractionOfAStepGivesThePlantTheMeanOfTheTwoHeldActionsWithinTheirBounds) {
  OneLane delayed({Channel("delay", "action/delay", 0, 3)}, {1.25});
  const std::vector<double> actions = {0.8, -0.4, 7, 0.2}, bounded = {0, 0, 0.8, -0.4, 1, 0.2};
  std::vector<double> held;
  for (size_t k = 0; k < 4; ++k) held.push_back(0.25 * bounded[k] + 0.75 * bounded[k + 1]);
  const auto expected = Plant(held);
  for (size_t k = 0; k < 4; ++k) {
    delayed.Step(actions[k]);
    EXPECT_EQ(delayed.Shown(), expected[k + 1]) << k;
  }
}

TEST(ChannelSimulator, BiasesAndDelaysChangeWhatIsShownAndNothingElse) {
  OneLane sensed({Channel("bias", "obs/v/bias", -1, 1), Channel("lag", "obs/x/delay", 0, 3)}, {0.25, 1.5});
  OneLane bare({}, {});
  std::vector<double> x = {bare.Shown()[0], bare.Shown()[0], bare.Shown()[0]};
  for (int step = 0; step < 10; ++step) {
    sensed.Step(ActionAt(step));
    bare.Step(ActionAt(step));
    x.push_back(bare.Shown()[0]);
    EXPECT_DOUBLE_EQ(sensed.Shown()[1], bare.Shown()[1] + 0.25);
    EXPECT_NEAR(sensed.Shown()[0], 0.5 * (x[x.size() - 2] + x[x.size() - 3]), 1e-12) << "one and a half steps old";
    EXPECT_EQ((*sensed).reward(kLane), (*bare).reward(kLane));
  }
}

TEST(ChannelSimulator, AScaleIsOfTheReadingAndNotOfItsBiasAndAStateIsSetAsItIsRead) {
  OneLane sensed({ScaleOf("obs/x/scale + obs/v/scale"), Channel("bias", "obs/v/bias", -1, 1)}, {1.25, 0.25});
  OneLane bare({}, {});
  for (int step = 0; step < 10; ++step) {
    sensed.Step(ActionAt(step));
    bare.Step(ActionAt(step));
    EXPECT_DOUBLE_EQ(sensed.Shown()[0], 1.25 * bare.Shown()[0]);
    EXPECT_DOUBLE_EQ(sensed.Shown()[1], 1.25 * bare.Shown()[1] + 0.25);
  }
  const std::vector<double> read = sensed.Shown(), is = {read[0] / 1.25, (read[1] - 0.25) / 1.25};
  ASSERT_TRUE((*sensed).SetState(kLane, read, {}));
  ASSERT_TRUE((*bare).SetState(kLane, is, {}));
  sensed.Step(0.7);
  bare.Step(0.7);
  EXPECT_NEAR(sensed.Shown()[0], 1.25 * bare.Shown()[0], 1e-12);
  EXPECT_NEAR(sensed.Shown()[1], 1.25 * bare.Shown()[1] + 0.25, 1e-12);
}

TEST(ChannelSimulator, NoiseIsWhiteGaussianWithItsStandardDeviation) {
  OneLane noisy({Channel("x", "obs/x/noise_std", 0, 1), Channel("v", "obs/v/noise_std", 0, 1)}, {0.1, 0.4},
                {.max_episode_steps = 0});
  const double x = [&] {
    OneLane still({}, {});
    return still.Shown()[0];
  }();
  constexpr int kSteps = 20000;
  double square_x = 0, square_v = 0, lagged = 0, crossed = 0, fourth = 0, before = 0;
  for (int step = 0; step < kSteps; ++step) {
    noisy.Step(0);
    const double e_x = noisy.Shown()[0] - x, e_v = noisy.Shown()[1];
    square_x += e_x * e_x / kSteps;
    square_v += e_v * e_v / kSteps;
    lagged += e_x * before / kSteps;
    crossed += e_x * e_v / kSteps;
    fourth += std::pow(e_x, 4) / kSteps;
    before = e_x;
  }
  EXPECT_NEAR(std::sqrt(square_x), 0.1, 0.002);
  EXPECT_NEAR(std::sqrt(square_v), 0.4, 0.008);
  EXPECT_NEAR(lagged / square_x, 0, 0.03) << "white";
  EXPECT_NEAR(crossed / std::sqrt(square_x * square_v), 0, 0.03) << "sensors are independent";
  EXPECT_NEAR(fourth / (square_x * square_x), 3, 0.2) << "a Gaussian's kurtosis";
}

TEST(ChannelSimulator, LanesWithEqualStartsDrawEqualNoiseAndOthersDoNot) {
  const auto factory = Factory({Channel("noise", "obs/*/noise_std", 0, 1)});
  const auto simulator = factory->Make(3, 1);
  const std::vector<int> lanes = {0, 1, 2};
  const std::vector<double> still = {0, 0, 0};
  for (const int lane : lanes) simulator->SetParameters(lane, std::vector<double>{1, 1, 0.5, lane == 1 ? 0.6 : 0.2});
  const auto noise = [&](int lane, double start) { return simulator->observation(lane)[0] - start; };
  for (const int lane : lanes) {
    ASSERT_TRUE(simulator->SetStateFromObservation(lane, std::vector<double>{lane == 2 ? 0.51 : 0.5, 0}));
  }
  simulator->Step(lanes, still);
  EXPECT_NE(noise(0, 0.5), 0);
  EXPECT_NEAR(noise(1, 0.5), 3 * noise(0, 0.5), 1e-12);
  EXPECT_GT(std::abs(noise(2, 0.51) - noise(0, 0.5)), 1e-6);

  std::vector<double> starts;
  for (const int lane : lanes) {
    Rng rng(lane == 2 ? 6 : 5);
    simulator->Reset(lane, rng);
    Rng same(lane == 2 ? 6 : 5);
    starts.push_back(same.Uniform(-1, 1));
  }
  EXPECT_NEAR(noise(1, starts[1]), 3 * noise(0, starts[0]), 1e-12);
  EXPECT_GT(std::abs(noise(2, starts[2]) - noise(0, starts[0])), 1e-6);
}

/// What a lane showed, and which action followed each row.
struct Log {
  std::vector<double> observations, actions;
  LoggedHistory Before(size_t row) const {
    return {std::span(observations).first(2 * row), std::span(actions).first(row)};
  }
  std::span<const double> Row(size_t row) const { return std::span(observations).subspan(2 * row, 2); }
};

Log Record(OneLane& lane, int n_steps) {
  Log log;
  for (int step = 0; step < n_steps; ++step) {
    const std::vector<double> shown = lane.Shown();
    log.observations.insert(log.observations.end(), shown.begin(), shown.end());
    log.actions.push_back(ActionAt(step));
    lane.Step(ActionAt(step));
  }
  return log;
}

TEST(ChannelSimulator, FromAnyLoggedRowTheTrueChannelsReproduceTheRestOfTheLog) {
  const std::vector<ParameterSpec> specs = {Channel("delay", "action/delay", 0, 3),
                                            Channel("bias", "obs/v/bias", -1, 1), Channel("x", "obs/x/delay", 0, 3),
                                            Channel("v", "obs/v/delay", 0, 3)};
  // Sensors in step, x older, v older; a fraction of an action delay.
  for (const std::vector<double>& z :
       std::vector<std::vector<double>>{{2, 0.3, 0, 0}, {1.5, 0, 2, 2}, {0, 0.3, 3, 1}, {2.5, -0.2, 0, 2}}) {
    OneLane truth(specs, z);
    const Log log = Record(truth, 14);
    for (const size_t start : {0u, 1u, 2u, 3u, 7u}) {
      OneLane replay(specs, z);
      ASSERT_TRUE((*replay).SetStateFromLog(kLane, log.Row(start), log.Before(start)));
      for (size_t row = start; row < 14; ++row) {
        EXPECT_NEAR(replay.Shown()[0], log.Row(row)[0], 1e-12) << z[0] << " from " << start << " at " << row;
        EXPECT_NEAR(replay.Shown()[1], log.Row(row)[1], 1e-12) << z[0] << " from " << start << " at " << row;
        replay.Step(log.actions[row]);
      }
    }
  }
}

TEST(ChannelSimulator, FromATrueStateTheTrueChannelsShowWhatWasLoggedOnceItIsOfThatState) {
  const std::vector<ParameterSpec> specs = {Channel("delay", "action/delay", 0, 3),
                                            Channel("bias", "obs/v/bias", -1, 1), Channel("v", "obs/v/delay", 0, 3)};
  const std::vector<double> z = {1.5, 0.3, 2.5}, no_lag = {1.5, 0.3, 0};
  OneLane truth(specs, z), at_once(specs, no_lag);
  const Log log = Record(truth, 14), states = Record(at_once, 14);
  EXPECT_EQ((*truth).spec().reading_ages, (std::vector<int>{0, 3}));
  for (const size_t start : {3u, 7u}) {
    OneLane replay(specs, z);
    ASSERT_TRUE((*replay).SetState(kLane, states.Row(start), log.Before(start)));
    for (size_t row = start; row < 14; ++row) {
      EXPECT_NEAR(replay.Shown()[0], log.Row(row)[0], 1e-12) << start << " at " << row;
      if (row >= start + 3) {
        EXPECT_NEAR(replay.Shown()[1], log.Row(row)[1], 1e-12) << start << " at " << row;
      }
      replay.Step(log.actions[row]);
    }
  }
}

TEST(ChannelSimulator, WithoutWhatWasLoggedBeforeADelayedReplayIsWrong) {
  const std::vector<ParameterSpec> specs = {Channel("delay", "action/delay", 0, 3)};
  OneLane truth(specs, {2}), replay(specs, {2});
  const Log log = Record(truth, 10);
  ASSERT_TRUE((*replay).SetStateFromObservation(kLane, log.Row(6)));
  replay.Step(log.actions[6]);
  EXPECT_GT(std::abs(replay.Shown()[1] - log.Row(7)[1]), 0.1);
}

TEST(ChannelSimulator, TheClockOfASetStateCountsFromTheStateThatIsShown) {
  const std::vector<ParameterSpec> specs = {Channel("x", "obs/x/delay", 0, 3)};
  OneLane truth(specs, {3}), replay(specs, {3});
  const Log log = Record(truth, 10);
  ASSERT_TRUE((*replay).SetStateFromLog(kLane, log.Row(6), log.Before(6)));
  for (int step = 1; step <= 20; ++step) {
    replay.Step(0.1);
    EXPECT_EQ((*replay).status(kLane), step < 20 ? LaneStatus::kRunning : LaneStatus::kTruncated) << step;
  }
}

TEST(ChannelSimulator, AStateThatThePlantRefusesWithoutTheBiasIsSetAsItWasLogged) {
  OneLane lane({Channel("bias", "obs/v/bias", -1, 1)}, {-0.5}, {.velocity_clip = 1.0});
  EXPECT_TRUE((*lane).SetStateFromObservation(kLane, std::vector<double>{0.0, 0.8})) << "v + 0.5 lies on the clip";
  EXPECT_FALSE((*lane).SetStateFromObservation(kLane, std::vector<double>{0.0, 1.0})) << "so does v itself";
}

TEST(ChannelSimulator, ADiscreteActionIsDelayedByTheNearestWholeNumber) {
  class Discrete : public PointMassFactory {
   public:
    Discrete() : discrete_(PointMassFactory::spec()) { discrete_.n_discrete_actions = 2; }
    const SimulatorSpec& spec() const override { return discrete_; }

   private:
    SimulatorSpec discrete_;
  };
  std::vector<ParameterSpec> specs = PointMass::MakeParameters().specs();
  specs.push_back(Channel("delay", "action/delay", 0, 3));
  const ChannelSimulatorFactory factory(specs, [](const auto&) { return std::make_unique<Discrete>(); });
  const auto simulator = factory.Make(1, 1);
  simulator->SetParameters(kLane, std::vector<double>{1, 1, 0.5, 1.4});
  Rng rng(1);
  simulator->Reset(kLane, rng);
  std::vector<double> velocities;
  for (const double action : {1.0, 0.0, 1.0, 1.0}) {
    simulator->Step({&kLane, 1}, {&action, 1});
    velocities.push_back(simulator->observation(kLane)[1]);
  }
  EXPECT_THAT(velocities, testing::ElementsAre(0, 1, 0, 1));
}

}  // namespace oted::channels_test
