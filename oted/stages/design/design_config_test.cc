#include "oted/stages/design/design_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/stages/design/design_method.h"

namespace oted::design_config_test {

using testing::HasSubstr;

TEST(DesignConfig, InThePapersMethodTheCloneActsFromLoggedStatesAndGSeesStateAndAction) {
  const DesignConfig config = DesignConfig::For(DesignMethod::kPaper);
  config.Check();
  const EvidenceConfig evidence = config.adversarial.Evidence({});
  EXPECT_TRUE(evidence.dataset_starts);
  EXPECT_FALSE(evidence.replayed_actions);
  EXPECT_FALSE(evidence.transitions) << "g(s, a)";
  EXPECT_EQ(config.method, DesignMethod::kPaper);
}

TEST(DesignConfig, TheTransitionsMethodReplaysLoggedActionsFromLoggedStates) {
  const EvidenceConfig evidence = DesignConfig::For(DesignMethod::kTransitions).adversarial.Evidence({});
  EXPECT_TRUE(evidence.dataset_starts && evidence.replayed_actions && evidence.transitions);
}

TEST(DesignConfig, LoggedActionsFromOtherStatesAreAContradiction) {
  DesignConfig config = DesignConfig::For(DesignMethod::kTransitions);
  config.adversarial.starts = RolloutStarts::kInitial;
  const std::string message = MessageOf<UsageError>([&] { config.Check(); });
  EXPECT_THAT(message, HasSubstr("design.adversarial.actions"));
  EXPECT_THAT(message, HasSubstr("set design.adversarial.actions = \"clone\""));
  config.adversarial.actions = RolloutActions::kClone;
  config.Check();
}

TEST(DesignConfig, JointTrainingNeedsACloneThatActs) {
  DesignConfig config = DesignConfig::For(DesignMethod::kPaper);
  config.adversarial.clone_updates = 5;
  config.Check();
  for (const DesignMethod method : {DesignMethod::kTrajectories, DesignMethod::kTransitions, DesignMethod::kImages}) {
    DesignConfig other = DesignConfig::For(method);
    other.adversarial.clone_updates = 5;
    EXPECT_THAT(MessageOf<UsageError>([&] { other.Check(); }), HasSubstr("clone_updates")) << Describe(method).name;
  }
}

TEST(DesignConfig, DropoRefusesAPriorItCannotUse) {
  DesignConfig config = DesignConfig::For(DesignMethod::kDropo);
  config.Check();
  config.prior = "gaussian";
  EXPECT_THAT(MessageOf<UsageError>([&] { config.Check(); }), HasSubstr("design.prior"));
}

TEST(DesignConfig, AMethodThatFindsAGaussianRefusesACategoricalDesigner) {
  for (const MethodDescription& described : DesignMethods()) {
    DesignConfig config = DesignConfig::For(described.method);
    config.designer = DesignerKind::kCategorical;
    if (!described.needs.gaussian_q) {
      config.Check();
      continue;
    }
    EXPECT_THAT(MessageOf<UsageError>([&] { config.Check(); }), HasSubstr("finds a Gaussian")) << described.name;
  }
}

}  // namespace oted::design_config_test
