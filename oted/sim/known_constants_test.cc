#include "oted/sim/known_constants.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/testing.h"

namespace oted::known_constants_test {

using testing::ElementsAre;
using testing::HasSubstr;

ParameterSpec Constant(const std::string& name, const std::string& path) {
  return {.name = name, .field = path, .low = -1e9, .high = 1e9, .scale = ParameterScale::kAbsolute, .is_known = true};
}

/// The point mass with its three parameters; the zeros of its sensors differ between recordings.
std::unique_ptr<SimulatorFactory> Factory(std::vector<ParameterSpec> constants = {Constant("x_zero", "obs/x/bias"),
                                                                                  Constant("v_zero", "obs/v/bias")}) {
  return WithConstants(PointMass::MakeParameters().specs(), constants, [](const std::vector<ParameterSpec>& all) {
    return WithChannels(all, [](const auto&) { return std::make_unique<PointMassFactory>(); });
  });
}

/// What the point mass shows a step after it was set to (0, 1) in a log with these constants, no action given.
std::vector<double> Shown(Simulator& simulator, const std::vector<double>& constants, bool by_state = false) {
  const std::vector<double> start = {0, 1}, idle(static_cast<size_t>(simulator.n_lanes()), 0.0);
  const LoggedHistory before{.observations = {}, .actions = {}, .constants = constants};
  EXPECT_TRUE(by_state ? simulator.SetState(0, start, before) : simulator.SetStateFromLog(0, start, before));
  const int lane = 0;
  simulator.Step({&lane, 1}, idle);
  return {simulator.observation(0).begin(), simulator.observation(0).end()};
}

// Damping 0.4: v' = 0.6 (1 - zero) + zero, x' = 0.1 v without the zeros.
TEST(KnownConstants, ALaneHasThoseOfTheRecordingThatItWasSetTo) {
  const auto simulator = Factory()->Make(1, 1);
  simulator->SetParameters(0, std::vector<double>{1, 0.4, 0.5});
  for (const bool by_state : {false, true}) {
    EXPECT_NEAR(Shown(*simulator, {0, 0.5}, by_state)[1], 0.8, 1e-12);
    EXPECT_NEAR(Shown(*simulator, {0, -0.5}, by_state)[1], 0.4, 1e-12);
    EXPECT_NEAR(Shown(*simulator, {}, by_state)[1], 0.6, 1e-12) << "as in the model";
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    EXPECT_NEAR(Shown(*simulator, {unknown, 0.5}, by_state)[1], 0.8, 1e-12) << "one of them as in the model";
  }
}

TEST(KnownConstants, ParametersThatChangeKeepTheRecording) {
  const auto simulator = Factory()->Make(1, 1);
  Shown(*simulator, {0, 0.5});
  simulator->SetParameters(0, std::vector<double>{1, 0.2, 0.5});
  EXPECT_NEAR(Shown(*simulator, {0, 0.5})[1], 0.9, 1e-12);
  simulator->SetParameters(0, std::vector<double>{1, 1, 0.5});
  const int lane = 0;
  const std::vector<double> idle = {0};
  simulator->Step({&lane, 1}, idle);
  EXPECT_NEAR(simulator->observation(0)[1], 0.5, 1e-12) << "at rest, a sensor shows its zero";
}

TEST(KnownConstants, AResetForgetsThem) {
  const auto factory = Factory();
  const auto simulator = factory->Make(2, 1);
  Shown(*simulator, {3, 0.5});
  for (const int lane : {0, 1}) {
    Rng rng(7);
    simulator->Reset(lane, rng);
  }
  EXPECT_THAT(simulator->observation(0), testing::ElementsAreArray(simulator->observation(1)));
}

TEST(KnownConstants, AreNoParametersButTakeTheirPlacesFromThem) {
  const auto factory = Factory();
  EXPECT_EQ(factory->parameters().size(), 3);
  EXPECT_THAT(factory->spec().constant_names, ElementsAre("x_zero", "v_zero"));
  const ParameterSpec freed{
      .name = "again", .field = "obs/v/bias", .low = -1, .high = 1, .scale = ParameterScale::kAbsolute};
  EXPECT_THAT(MessageOf<UsageError>([&] { factory->With({freed}); }), HasSubstr("set the same channel"));
}

TEST(KnownConstants, WithFurtherParametersTheyStayLast) {
  const ParameterSpec freed{
      .name = "delay", .field = "action/delay", .low = 0, .high = 2, .scale = ParameterScale::kAbsolute};
  const auto factory = Factory()->With({freed});
  ASSERT_EQ(factory->parameters().size(), 4);
  EXPECT_EQ(factory->parameters()[3].name, "delay");
  const auto simulator = factory->Make(1, 1);
  simulator->SetParameters(0, std::vector<double>{1, 0.4, 0.5, 0});
  EXPECT_NEAR(Shown(*simulator, {0, 0.5})[1], 0.8, 1e-12);
}

TEST(KnownConstants, DelaysAndNoiseAreRefused) {
  for (const char* path : {"action/delay", "obs/v/delay", "obs/v/noise_std"}) {
    EXPECT_THAT(MessageOf<UsageError>([&] { Factory({Constant("c", path)}); }),
                HasSubstr("wanted a field of the model"));
  }
}

TEST(WithConstants, WithoutAnyIsTheFactoryItself) {
  EXPECT_NE(dynamic_cast<PointMassFactory*>(Factory({}).get()), nullptr);
}

}  // namespace oted::known_constants_test
