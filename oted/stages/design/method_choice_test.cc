#include "oted/stages/design/method_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "oted/sim/testing.h"

namespace oted::method_choice_test {

using testing::HasSubstr;

const std::vector<DesignMethod> kMethods = {DesignMethod::kTrajectories, DesignMethod::kTransitions,
                                            DesignMethod::kPaper};
const std::vector<std::vector<double>> kModes = {{1, 1, 0.5}, {1.1, 1, 0.5}, {1.2, 1, 0.5}};

/// Windows whose errors are `first` for the first method and for the others that times exp(log_ratios + chance).
HeldOutErrors ErrorsOf(const std::vector<double>& log_ratios, double chance, int n_windows = 50) {
  HeldOutErrors errors{.n_steps = 10, .n_windows = n_windows, .of = std::vector<std::vector<double>>(4)};
  Rng rng(1);
  for (int w = 0; w < n_windows; ++w) {
    const double first = 2 * std::exp(rng.Normal());
    errors.of[0].push_back(first);
    for (size_t k = 0; k < 2; ++k) errors.of[k + 1].push_back(first * std::exp(log_ratios[k] + chance * rng.Normal()));
    errors.of[3].push_back(5 * first);
  }
  return errors;
}

TEST(ChooseByHeldOut, TakesTheMethodWhoseSimulatorIsNearestAndSaysByHowMuch) {
  const MethodChoice choice = ChooseByHeldOut(kMethods, kModes, ErrorsOf({std::log(0.9), std::log(0.75)}, 0.01));
  EXPECT_EQ(choice.method, DesignMethod::kPaper);
  EXPECT_THAT(choice.reason, HasSubstr("50 held-out windows of 10 control steps nearest to the log: 25 % nearer"));
  ASSERT_EQ(choice.tried.size(), 3u);
  EXPECT_NEAR(choice.tried[1].gain, -std::log(0.9), 0.01);
  EXPECT_NEAR(choice.tried[2].error / choice.tried[0].error, 0.75, 0.01);
  EXPECT_NEAR(choice.nominal_error / choice.tried[0].error, 5, 1e-9);
}

TEST(ChooseByHeldOut, ChanceDoesNotTakeTheChoiceFromTheFirstMethod) {
  // Of a gain of 3 %, seven times which the windows scatter by, 50 of them tell nothing.
  const MethodChoice choice = ChooseByHeldOut(kMethods, kModes, ErrorsOf({-0.03, 0.5}, 0.2));
  EXPECT_EQ(choice.method, DesignMethod::kTrajectories);
  EXPECT_THAT(choice.reason, HasSubstr("no other method"));
  EXPECT_THAT(choice.reason, HasSubstr("transitions"));
  EXPECT_THAT(choice.reason, HasSubstr("paper"));
  EXPECT_EQ(ChooseByHeldOut(kMethods, kModes, ErrorsOf({-0.03, 0.5}, 0.01)).method, DesignMethod::kTransitions)
      << "unless it is sure";
}

TEST(ChooseByHeldOut, AGainThatNobodyWouldNoticeIsNone) {
  EXPECT_EQ(ChooseByHeldOut(kMethods, kModes, ErrorsOf({-0.5 * kLeastGain, 0.5}, 0)).method,
            DesignMethod::kTrajectories);
}

TEST(ChooseByHeldOut, OneWindowThatBreaksDoesNotDecide) {
  HeldOutErrors errors = ErrorsOf({-0.2, 0.5}, 0.01);
  errors.of[1][7] = kBrokenDownError;
  EXPECT_EQ(ChooseByHeldOut(kMethods, kModes, errors).method, DesignMethod::kTransitions);
}

TEST(KeepFirstMethod, OthersAreTriedWhereMoreIsLeftThanTheSensorsExplainAndNothingIsWon) {
  HeldOutPrediction prediction;
  prediction.horizons.resize(1);
  prediction.horizons[0].channels = {{.nominal = 2, .designed = 1, .floor = 1, .spread = 5, .excess = {}, .gain = {}}};
  prediction.horizons[0].excess = {0.01, 0.1};
  EXPECT_FALSE(AsksForOtherMethods(prediction));
  EXPECT_THAT(KeepFirstMethod(prediction).reason, HasSubstr("as near to the logs as the sensors let them"));
  prediction.horizons[0].excess = {1, 0.1};
  EXPECT_TRUE(AsksForOtherMethods(prediction));
  EXPECT_THAT(KeepFirstMethod(prediction).reason, HasSubstr("too little of the logs"));
  prediction.horizons[0].gain = {1, 0.1};
  EXPECT_FALSE(AsksForOtherMethods(prediction));
  EXPECT_THAT(KeepFirstMethod(prediction).reason, HasSubstr("surely predicts better than the nominal"));
  prediction.horizons[0].excess = {0.1, 0.6};  // too few windows to tell whether the floor is reached
  EXPECT_THAT(KeepFirstMethod(prediction).reason, HasSubstr("surely predicts better than the nominal"));
  prediction.horizons[0].gain = {0, 0.3};
  EXPECT_THAT(KeepFirstMethod(prediction).reason, HasSubstr("too little of the logs can be predicted"));
  EXPECT_FALSE(AsksForOtherMethods(std::nullopt)) << "nothing can be compared";
  prediction.horizons[0].gain = {};
  prediction.horizons[0].channels[0].spread = 1;
  EXPECT_FALSE(AsksForOtherMethods(prediction)) << "none predicts better than the mean";
  EXPECT_THAT(KeepFirstMethod(prediction).reason, HasSubstr("these logs show nothing"));
}

TEST(ChooseByCapability, SaysWhatTheTaskCannotDo) {
  SimulatorSpec spec;
  EXPECT_THAT(ChooseByCapability(FirstMethodOfAuto({}, spec), spec).reason, HasSubstr("cannot be set"));
  spec.image_shape = {7, 7, 3};
  const MethodChoice of_images = ChooseByCapability(FirstMethodOfAuto({}, spec), spec);
  EXPECT_EQ(of_images.method, DesignMethod::kImages);
  EXPECT_THAT(of_images.reason, HasSubstr("images"));
}

TEST(MethodChoice, ComesBackFromJson) {
  MethodChoice choice = ChooseByHeldOut(kMethods, kModes, ErrorsOf({-0.2, 0.1}, 0.01));
  choice.setting = "default";
  choice.picked = "default-transitions";
  EXPECT_EQ(ToJson(MethodChoiceFromJson(ToJson(choice))), ToJson(choice));
  EXPECT_EQ(ToJson(MethodChoiceFromJson(nlohmann::json::parse(ToJson(choice).dump()))).dump(), ToJson(choice).dump());
}

}  // namespace oted::method_choice_test
