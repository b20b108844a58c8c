#include "oted/sim/channel_factory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oted/base/error.h"
#include "oted/sim/channel_suspects.h"
#include "oted/sim/testing.h"

namespace oted::channel_factory_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

ParameterSpec Channel(const std::string& name, const std::string& path, double low = 0, double high = 1) {
  return {.name = name, .field = path, .low = low, .high = high, .scale = ParameterScale::kAbsolute};
}

std::unique_ptr<SimulatorFactory> Make(std::vector<ParameterSpec> channels, bool first = false) {
  std::vector<ParameterSpec> specs = PointMass::MakeParameters().specs();
  specs.insert(first ? specs.begin() : specs.end(), channels.begin(), channels.end());
  return WithChannels(specs, [](const auto&) { return std::make_unique<PointMassFactory>(); });
}

TEST(WithChannels, WithoutChannelParametersIsThePlantsOwnFactory) {
  EXPECT_NE(dynamic_cast<PointMassFactory*>(Make({}).get()), nullptr);
  EXPECT_EQ(dynamic_cast<PointMassFactory*>(Make({Channel("d", "action/delay")}).get()), nullptr);
}

TEST(WithChannels, ParametersKeepTheUsersOrderAndThePlantGetsItsOwn) {
  const auto factory = Make({Channel("delay", "action/delay", 0, 4)}, true);
  const ParameterSpace& space = factory->parameters();
  ASSERT_EQ(space.size(), 4);
  EXPECT_EQ(space[0].name, "delay");
  EXPECT_EQ(space[1].name, "gain");
  EXPECT_THAT(space.Nominal(), ElementsAre(0, 1, 1, 1));
  const auto simulator = factory->Make(1, 1);
  simulator->SetParameters(0, std::vector<double>{0, 1.5, 0.4, 0.2});
  ASSERT_TRUE(simulator->SetStateFromObservation(0, std::vector<double>{0, 1}));
  const double action = 1;
  const std::vector<int> lanes = {0};
  simulator->Step(lanes, {&action, 1});
  EXPECT_DOUBLE_EQ(simulator->observation(0)[1], 0.6 * 1 + 1.5 * 1) << "(1 - damping) v + gain a";
}

TEST(WithChannels, WhatThePlantCannotDoTheWrappedOneSaysInItsWords) {
  const PointMassFactory plant;
  const auto wrapped = Make({Channel("d", "action/delay")});
  std::string of_plant, of_wrapped;
  EXPECT_EQ(plant.MakeRenderer(8, 8, &of_plant), nullptr);
  EXPECT_EQ(wrapped->MakeRenderer(8, 8, &of_wrapped), nullptr);
  EXPECT_THAT(of_wrapped, HasSubstr("'PointMass' cannot be drawn"));
  EXPECT_EQ(of_wrapped, of_plant);
  EXPECT_FALSE(wrapped->has_expert());
  Rng rng(1);
  double action = 0;
  EXPECT_THAT(
      [&] {
        wrapped->Make(1, 1)->TakeTaskPolicy(TaskPolicy::kExpert, 0, rng, {&action, 1});
      },
      ThrowsMessage<UsageError>(HasSubstr("no policy of its own")));
}

TEST(WithChannels, TheTasksEndIsThePlantsWithoutTheBias) {
  std::vector<ParameterSpec> specs = PointMass::MakeParameters().specs();
  specs.push_back(Channel("bias", "obs/x/bias", -1, 1));
  const auto factory = WithChannels(
      specs, [](const auto&) { return std::make_unique<PointMassFactory>(PointMassOptions{.terminate_beyond = 0.9}); });
  const auto simulator = factory->Make(1, 1);
  simulator->SetParameters(0, std::vector<double>{1, 1, 0.5, 0.3});
  EXPECT_EQ(simulator->EndsAt(0, std::vector<double>{1.1, 0}), false);
  EXPECT_EQ(simulator->EndsAt(0, std::vector<double>{1.3, 0}), true);
}

TEST(WithChannels, UnitsAreControlStepsOrTheObservationsOwn) {
  const auto factory =
      Make({Channel("delay", "action/delay"), Channel("lag", "obs/*/delay"), Channel("bias", "obs/x/bias")});
  EXPECT_EQ(factory->parameters()[3].unit, "control steps");
  EXPECT_EQ(factory->parameters()[4].unit, "control steps");
  EXPECT_EQ(factory->parameters()[5].unit, "unit of the observation") << "the point mass declares none";

  SimulatorSpec spec = PointMass::MakeSpec({});
  spec.observation_units = {"m", "m/s"};
  EXPECT_EQ(DescribeChannel(spec, "obs/v/bias").unit, "m/s");
  EXPECT_EQ(DescribeChannel(spec, "obs/*/bias").unit, "unit of the observation") << "they differ";
}

TEST(WithChannels, DelaysTellHowManyPastActionsMatter) {
  EXPECT_EQ(Make({Channel("bias", "obs/x/bias")})->spec().n_past_actions, 0);
  EXPECT_EQ(Make({Channel("d", "action/delay", 0, 2.5), Channel("l", "obs/x/delay", 0, 2)})->spec().n_past_actions, 5);
}

TEST(ResolveChannel, ANameAGlobAndANumberPickActionsAndObservations) {
  SimulatorSpec spec = PointMass::MakeSpec({});
  EXPECT_THAT(ResolveChannel(spec, "obs/*/noise_std").channels, ElementsAre(0, 1));
  EXPECT_THAT(ResolveChannel(spec, "obs/v/bias").channels, ElementsAre(1));
  EXPECT_THAT(ResolveChannel(spec, "obs/#1/delay").channels, ElementsAre(1));
  EXPECT_THAT(ResolveChannel(spec, "obs/0/delay").channels, ElementsAre(0));
  spec.act_dim = 3;
  spec.action_names = {"actuator/hip", "actuator/knee", "actuator/ankle"};
  EXPECT_THAT(ResolveChannel(spec, "action/delay").channels, ElementsAre(0, 1, 2));
  EXPECT_THAT(ResolveChannel(spec, "action/actuator/knee/delay").channels, ElementsAre(1));
  EXPECT_THAT(ResolveChannel(spec, "action/*k*/delay").channels, ElementsAre(1, 2));
  EXPECT_THAT(ResolveChannel(spec, "action/#2/delay").channels, ElementsAre(2));
}

TEST(ResolveChannel, AnObservationsNameMayHaveSlashes) {
  SimulatorSpec spec = PointMass::MakeSpec({});
  spec.observation_names = {"arm/x", "arm/v"};
  EXPECT_THAT(ResolveChannel(spec, "obs/arm/v/bias").channels, ElementsAre(1));
}

TEST(ResolveChannel, APathThatMatchesNothingNamesWhatThereIs) {
  const auto make = [](const std::string& path) { return [=] { Make({Channel("p", path)}); }; };
  EXPECT_THAT(make("obs/vel/bias"), ThrowsMessage<UsageError>(AllOf(HasSubstr("'vel'"), HasSubstr("x, v"))));
  EXPECT_THAT(make("obs/2/bias"), ThrowsMessage<UsageError>(HasSubstr("x, v")));
  EXPECT_THAT(make("obs/x/bais"), ThrowsMessage<UsageError>(HasSubstr("did you mean 'bias'?")));
  EXPECT_THAT(make("obs/bias"), ThrowsMessage<UsageError>(HasSubstr("obs/NAME/bias")));
  EXPECT_THAT(make("action/noise"), ThrowsMessage<UsageError>(HasSubstr("action/NAME/delay")));
  EXPECT_THAT(make("action/knee/delay"), ThrowsMessage<UsageError>(HasSubstr("no action matches 'knee'")));
}

TEST(ResolveChannel, TiedPathsAreOneFieldWhereTheyAreOfOneKind) {
  const SimulatorSpec spec = PointMass::MakeSpec({});
  EXPECT_THAT(ResolveChannel(spec, "obs/v/scale + obs/x/scale + obs/v/scale").channels, ElementsAre(0, 1));
  EXPECT_THAT([&] { ResolveChannel(spec, "obs/v/scale + obs/x/bias"); },
              ThrowsMessage<UsageError>(HasSubstr("'obs/x/bias' is of another kind than 'obs/v/scale'")));
}

TEST(ResolveChannel, AScaleIsAFactorAboveZero) {
  const auto make = [](double low, double high, ParameterScale scale) {
    return [=] { Make({{.name = "s", .field = "obs/x/scale", .low = low, .high = high, .scale = scale}}); };
  };
  EXPECT_NO_THROW(make(0.5, 2, ParameterScale::kNominal)());
  EXPECT_THAT(make(0.5, 2, ParameterScale::kAbsolute), ThrowsMessage<UsageError>(HasSubstr("leave scale")));
  EXPECT_THAT(make(-1, 2, ParameterScale::kNominal), ThrowsMessage<UsageError>(HasSubstr("above 0")));
  EXPECT_THAT(make(1.1, 2, ParameterScale::kNominal), ThrowsMessage<UsageError>(HasSubstr("holds 1")));
}

TEST(ChannelSuspects, AnEncodersScaleIsThatOfItsVelocityAsWell) {
  SimulatorSpec spec = PointMass::MakeSpec({});
  spec.control_period_s = 0.01;
  spec.observation_units = {"m", "m/s"};
  spec.rate_of = {-1, 0};
  const auto paths = [&](const std::string& searched) {
    std::vector<ParameterSpec> specs;
    if (!searched.empty()) specs.push_back({.name = "s", .field = searched, .low = 0.5, .high = 2});
    std::vector<std::string> found;
    for (const ParameterSpec& suspect : ChannelSuspects(spec, ParameterSpace(specs))) found.push_back(suspect.field);
    return found;
  };
  EXPECT_THAT(paths(""), testing::Contains("obs/x/scale + obs/v/scale"));
  EXPECT_THAT(paths("obs/x/scale"), testing::Not(testing::Contains(HasSubstr("/scale")))) << "it is searched";
}

TEST(ResolveChannel, MultiplesOfTheNominalValueAndRangesThatMissItAreErrors) {
  ParameterSpec multiple = Channel("d", "action/delay", 0, 4);
  multiple.scale = ParameterScale::kNominal;
  EXPECT_THAT([&] { Make({multiple}); }, ThrowsMessage<UsageError>(HasSubstr("absolute")));
  EXPECT_THAT([] { Make({Channel("d", "action/delay", 1, 4)}); }, ThrowsMessage<UsageError>(HasSubstr("holds 0")));
  ParameterSpec logarithmic = Channel("n", "obs/*/noise_std", 0.001, 0.1);
  logarithmic.logarithmic = true;
  EXPECT_THAT([&] { Make({logarithmic}); }, ThrowsMessage<UsageError>(HasSubstr("drop 'log'")));
  EXPECT_THAT([] { Make({Channel("n", "obs/*/noise_std", -1, 1)}); },
              ThrowsMessage<UsageError>(HasSubstr("cannot be negative")));
  EXPECT_THAT([] { Make({Channel("d", "obs/x/delay", 0, 1e6)}); }, ThrowsMessage<UsageError>(HasSubstr("at most")));
}

TEST(ResolveChannel, TwoParametersOnOneChannelAreAnError) {
  EXPECT_THAT(
      [] {
        Make({Channel("a", "obs/*/bias"), Channel("b", "obs/v/bias")});
      },
      ThrowsMessage<UsageError>(AllOf(HasSubstr("'a'"), HasSubstr("'b'"), HasSubstr("same channel"))));
  EXPECT_THAT(
      [] {
        Make({Channel("a", "action/delay"), Channel("b", "action/0/delay")});
      },
      ThrowsMessage<UsageError>(HasSubstr("same channel")));
  EXPECT_NO_THROW(Make({Channel("a", "obs/x/bias"), Channel("b", "obs/v/bias"), Channel("c", "obs/x/delay")}));
}

TEST(ChannelOffers, NameEveryObservationWithTheValueThatChangesNothing) {
  const std::vector<ParameterOffer> offers = ChannelOffers(PointMass::MakeSpec({}));
  ASSERT_EQ(offers.size(), 5u);
  EXPECT_EQ(offers[0].path, "action/delay");
  EXPECT_EQ(offers[1].places[1].path, "obs/v/noise_std");
  for (const ParameterOffer& offer : offers) {
    EXPECT_FALSE(offer.meaning.empty());
    for (const ParameterPlace& place : offer.places) EXPECT_EQ(place.nominal, offer.path.ends_with("/scale") ? 1 : 0);
  }
}

}  // namespace oted::channel_factory_test
