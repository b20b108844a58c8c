#include "oted/stages/design/design_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/stages/design/design_method.h"

namespace oted::design_choice_test {

using testing::HasSubstr;

SimulatorSpec Settable() {
  SimulatorSpec spec;
  spec.can_set_state = true;
  return spec;
}

DesignChoice Of(DesignMethod method) {
  DesignChoice choice;
  choice.method = method;
  return choice;
}

TEST(DesignChoice, AutoMatchesTrajectoriesWhereStatesCanBeSetAndIsThePapersMethodElsewhere) {
  const DesignChoice choice;
  choice.Check();
  EXPECT_FALSE(choice.method);
  const ParameterSpace none, sensors({ParseParameterSpec("noise=obs/*/noise_std:0:0.1:absolute")});
  EXPECT_EQ(choice.Resolved(none, Settable()).method, DesignMethod::kTrajectories);
  EXPECT_EQ(choice.Resolved(sensors, Settable()).method, DesignMethod::kTransitions)
      << "noise cannot be fitted step by step";
  SimulatorSpec positions_alone;
  positions_alone.hidden.push_back({.name = "joint/hip/qvel"});
  EXPECT_EQ(choice.Resolved(none, positions_alone).method, DesignMethod::kTrajectories);
  const ParameterSpace lag({ParseParameterSpec("lag=obs/*/delay:0:3:absolute")});
  EXPECT_EQ(choice.Resolved(lag, Settable()).method, DesignMethod::kTrajectories);
  EXPECT_EQ(choice.Resolved(none, SimulatorSpec{}).method, DesignMethod::kPaper);
}

TEST(DesignChoice, MethodsThatReplayTheLogNeedStatesThatCanBeSet) {
  for (const MethodDescription& described : DesignMethods()) {
    if (!described.needs.settable_state && !described.needs.replays) continue;
    EXPECT_THAT(MessageOf<UsageError>([&] { Of(described.method).Resolved(ParameterSpace(), SimulatorSpec{}); }),
                testing::AllOf(HasSubstr(described.name), HasSubstr("use auto or paper")));
  }
}

TEST(DesignChoice, WhatWasGivenHoldsForEveryMethodAndTheRestIsThatMethods) {
  DesignChoice choice;
  choice.Set("adversarial.n_iterations", 7, "here");
  choice.Set("adversarial.lambda", 0.5, "here");
  DesignConfig expected = DesignConfig::For(DesignMethod::kPaper);
  expected.adversarial.n_iterations = 7;
  expected.adversarial.lambda = 0.5;
  EXPECT_EQ(choice.Resolved(DesignMethod::kPaper, Settable()).ToJson(), expected.ToJson());
  EXPECT_EQ(choice.Resolved(DesignMethod::kTransitions, Settable()).adversarial.n_iterations, 7);
}

TEST(DesignChoice, TheOrderInWhichMethodAndSettingsAreGivenMeansNothing) {
  DesignChoice one, two;
  one.SetText("adversarial.horizon", "50", "here");
  one.SetText("method", "paper", "here");
  two.SetText("method", "paper", "here");
  two.SetText("adversarial.horizon", "50", "here");
  EXPECT_EQ(one.ToJson(), two.ToJson());
  EXPECT_EQ(one.Assumed().adversarial.horizon, 50);
  EXPECT_EQ(one.Assumed().adversarial.n_steps, 150);
}

TEST(DesignChoice, WhereNoStateCanBeSetRolloutsBeginAtResetsAndTheCloneActs) {
  DesignChoice choice = Of(DesignMethod::kTransitions);
  choice.Set("adversarial.n_steps", 7, "here");
  const AdversarialConfig config = choice.Resolved(ParameterSpace(), SimulatorSpec{}).adversarial;
  EXPECT_EQ(config.starts, RolloutStarts::kInitial);
  EXPECT_EQ(config.actions, RolloutActions::kClone);
  EXPECT_EQ(config.rows, LoggedRows::kFirst);
  EXPECT_EQ(config.horizon, 300);
  EXPECT_EQ(config.n_steps, 7) << "it was given";
  EXPECT_EQ(config.evidence, SeenByG::kTransition);
  const DesignConfig paper = Of(DesignMethod::kPaper).Resolved(ParameterSpace(), SimulatorSpec{});
  EXPECT_EQ(paper.adversarial.starts, RolloutStarts::kInitial);
  EXPECT_EQ(paper.adversarial.evidence, SeenByG::kStateAction);
  EXPECT_EQ(paper.discriminator.hidden, DiscriminatorConfig().hidden) << "its g is larger, and learns more slowly";
}

TEST(DesignChoice, StartsAtResetsBringTheSettingsOfAlgorithm1ToTheLetter) {
  DesignChoice choice = Of(DesignMethod::kPaper);
  choice.Set("adversarial.starts", "initial", "here");
  choice.Set("adversarial.step_mean", 0.25, "here");
  const DesignConfig config = choice.Resolved(ParameterSpace(), Settable());
  config.Check();
  EXPECT_EQ(config.adversarial.starts, RolloutStarts::kInitial);
  EXPECT_EQ(config.adversarial.rows, LoggedRows::kFirst);
  EXPECT_EQ(config.adversarial.horizon, 300);
  EXPECT_EQ(config.adversarial.step_mean, 0.25) << "it was given";
}

TEST(DesignChoice, AnUnknownMethodIsRefusedWithTheNearestName) {
  DesignChoice choice;
  const std::string message = MessageOf<UsageError>([&] { choice.Set("method", "papr", "here"); });
  EXPECT_THAT(message, HasSubstr("papr"));
  EXPECT_THAT(message, HasSubstr("did you mean 'paper'?"));
}

TEST(DesignChoice, AKeyOfFormerTimesIsToldItsNewName) {
  DesignChoice choice;
  const auto refusal = [&](const std::string& key) {
    return MessageOf<UsageError>([&] { choice.SetText(key, "1", "here"); });
  };
  EXPECT_THAT(refusal("form"), HasSubstr("design.form is now design.method"));
  EXPECT_THAT(refusal("trajectory_window"), HasSubstr("design.trajectories.window"));
  EXPECT_THAT(refusal("discriminator"), HasSubstr("design.adversarial.evidence"));
  EXPECT_THAT(refusal("discriminator_steps"), HasSubstr("design.discriminator.steps"));
  EXPECT_THAT(refusal("trajectoris.window"), HasSubstr("did you mean 'design.trajectories'?"));
}

TEST(DesignChoice, JointTrainingTakesContinuousActions) {
  DesignChoice choice = Of(DesignMethod::kPaper);
  choice.Set("adversarial.clone_updates", 5, "here");
  SimulatorSpec discrete;
  discrete.n_discrete_actions = 3;
  EXPECT_THAT(MessageOf<UsageError>([&] { choice.Resolved(ParameterSpace(), discrete); }),
              HasSubstr("continuous actions"));
}

TEST(DesignMethods, EverySimulatorHasExactlyOneThatAutoBeginsWith) {
  for (const bool settable : {false, true}) {
    for (const bool images : {false, true}) {
      for (const bool of_noise : {false, true}) {
        for (const bool hidden : {false, true}) {
          SimulatorSpec spec;
          spec.can_set_state = settable;
          if (images) spec.image_shape = {7, 7, 3};
          if (hidden && !settable) spec.hidden.push_back({.name = "joint/hip/qvel"});
          int n = 0;
          for (const MethodDescription& described : DesignMethods()) {
            n += described.first_of_auto != nullptr && described.first_of_auto(spec, of_noise);
          }
          EXPECT_EQ(n, 1) << settable << images << of_noise << hidden;
        }
      }
    }
  }
}

TEST(DesignMethods, EachIsFoundByItsNameAndNamesSectionsThatExist) {
  for (const MethodDescription& described : DesignMethods()) {
    EXPECT_EQ(MethodNamed(described.name), described.method);
    DesignConfig config = DesignConfig::For(described.method);
    config.Check();
    std::vector<std::string> names;
    for (const FieldList& section : config.Sections()) names.push_back(section.section());
    for (const std::string& section : described.sections) {
      EXPECT_THAT(names, testing::Contains("design." + section)) << described.name;
    }
  }
}

TEST(DefaultInWords, ListsTheMethodsThatHaveAnother) {
  EXPECT_EQ(DefaultInWords("design.adversarial", "horizon"), "10; paper: 30; images: 8");
  EXPECT_EQ(DefaultInWords("design.trajectories", "window"), "16");
  EXPECT_FALSE(DependsOnMethod("design", "prior"));
}

}  // namespace oted::design_choice_test
