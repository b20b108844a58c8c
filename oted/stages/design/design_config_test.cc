#include "oted/stages/design/design_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"

namespace oted::design_config_test {

using testing::HasSubstr;

TEST(DesignConfig, ThePapersFormIsAlgorithm1FromTheInitialStates) {
  const DesignConfig config = DesignConfig::ForForm("paper");
  config.Check();
  const EvidenceConfig evidence = config.Evidence({});
  EXPECT_FALSE(evidence.dataset_starts);
  EXPECT_FALSE(evidence.replayed_actions);
  EXPECT_FALSE(evidence.transitions) << "g(s, a)";
  EXPECT_EQ(config.form, "paper");
}

TEST(DesignConfig, TheDefaultMatchesTrajectoriesWhereStatesCanBeSetAndIsThePapersFormElsewhere) {
  SimulatorSpec settable, other;
  settable.can_set_state = true;
  DesignConfig config;
  config.Check();
  EXPECT_EQ(config.form, "auto");
  const ParameterSpace none, sensors({ParseParameterSpec("noise=obs/*/noise_std:0:0.1:absolute")});
  EXPECT_EQ(config.Resolved(none, settable).form, "trajectories");
  EXPECT_EQ(config.Resolved(sensors, settable).form, "transitions") << "noise cannot be fitted step by step";
  DesignConfig paper = config.Resolved(none, other), by_name = DesignConfig::ForForm("paper");
  EXPECT_EQ(paper.Fields().ToJson(), by_name.Fields().ToJson());
}

TEST(DesignConfig, FormsThatReplayTheLogNeedStatesThatCanBeSet) {
  for (const std::string form : {"trajectories", "least-squares", "dropo"}) {
    const DesignConfig config = DesignConfig::ForForm(form);
    EXPECT_THAT(MessageOf<UsageError>([&] { config.Resolved({}, SimulatorSpec{}); }),
                testing::AllOf(HasSubstr(form), HasSubstr("use auto or paper")));
  }
}

TEST(DesignConfig, WhatWasSetStaysWhenAutoIsSettled) {
  DesignConfig config;
  config.n_iterations = 7;
  config.lambda = 0.5;
  const DesignConfig paper = config.Resolved({}, SimulatorSpec{});
  EXPECT_EQ(paper.n_iterations, 7);
  EXPECT_EQ(paper.lambda, 0.5);
  EXPECT_EQ(paper.horizon, DesignConfig::ForForm("paper").horizon);
}

TEST(DesignConfig, InAnotherFormWhatWasSetStaysAndTheRestIsThatForms) {
  DesignConfig config = DesignConfig::ForForm("trajectories");
  config.n_sims = 9;
  DesignConfig paper = config.InForm("paper"), expected = DesignConfig::ForForm("paper");
  expected.n_sims = 9;
  EXPECT_EQ(paper.Fields().ToJson(), expected.Fields().ToJson());
  EXPECT_EQ(paper.InForm("trajectories").Fields().ToJson(), config.Fields().ToJson());
}

TEST(DesignConfig, RemembersThatTheFormWasLeftOpenAndNeverSaysSoOtherwise) {
  SimulatorSpec settable;
  settable.can_set_state = true;
  EXPECT_TRUE(DesignConfig().Resolved({}, settable).by_auto);
  EXPECT_TRUE(DesignConfig().Resolved({}, settable).Resolved({}, settable).by_auto);
  EXPECT_FALSE(DesignConfig::ForForm("trajectories").Resolved({}, settable).by_auto);
}

TEST(DesignConfig, TheTransitionsFormReplaysLoggedActionsFromLoggedStates) {
  const EvidenceConfig evidence = DesignConfig::ForForm("transitions").Evidence({});
  EXPECT_TRUE(evidence.dataset_starts && evidence.replayed_actions && evidence.transitions);
}

TEST(DesignConfig, AnUnknownFormIsRefusedWithTheNearestName) {
  const std::string message = MessageOf<UsageError>([] { DesignConfig::ForForm("papr"); });
  EXPECT_THAT(message, HasSubstr("papr"));
  EXPECT_THAT(message, HasSubstr("did you mean 'paper'?"));
}

TEST(DesignConfig, LoggedActionsFromOtherStatesAreAContradiction) {
  DesignConfig config;
  config.starts = "initial";
  const std::string message = MessageOf<UsageError>([&] { config.Check(); });
  EXPECT_THAT(message, HasSubstr("design.actions"));
  EXPECT_THAT(message, HasSubstr("set design.actions = \"clone\""));
  config.actions = "clone";
  config.Check();
}

TEST(DesignConfig, JointTrainingNeedsACloneThatActs) {
  DesignConfig config = DesignConfig::ForForm("paper");
  config.clone_updates = 5;
  config.Check();
  for (const std::string form : {"trajectories", "transitions", "images"}) {
    DesignConfig other = DesignConfig::ForForm(form);
    other.clone_updates = 5;
    EXPECT_THAT(MessageOf<UsageError>([&] { other.Check(); }), HasSubstr("clone_updates")) << form;
  }
  SimulatorSpec discrete;
  discrete.n_discrete_actions = 3;
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Resolved({}, discrete); }), HasSubstr("continuous actions"));
}

TEST(DesignConfig, DropoRefusesAPriorItCannotUse) {
  DesignConfig config = DesignConfig::ForForm("dropo");
  config.Check();
  config.prior = "gaussian";
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Check(); }), HasSubstr("design.prior"));
}

}  // namespace oted::design_config_test
