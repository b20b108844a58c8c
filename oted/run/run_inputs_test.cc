// [task] of a configuration: a built-in task, or a model.

#include "oted/run/run_inputs.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/config/run_config.h"
#include "oted/config/task_registry.h"
#include "oted/sim/testing.h"

namespace oted::run_inputs_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

constexpr const char* kTask = R"([task]
model = "robots/arm.xml"
control_period = 0.02
observations = ["joint/*/qpos", "sensor/imu"]
action_range = [-1, 1]
reward = "d_x - 0.1 * sum2_action"
[task.quantities]
x = "body/torso/xpos[0]"
)";

TEST(TaskConfig, AModelAndItsKeysAreReadAndWrittenBack) {
  const TaskConfig task = RunConfig::FromToml(kTask, "configs/mine.toml").task;
  EXPECT_EQ(task.name, "arm") << "the file's name, where none is given";
  EXPECT_EQ(task.model.model, "configs/robots/arm.xml");
  EXPECT_THAT(task.model.observations, ElementsAre("joint/*/qpos", "sensor/imu"));
  EXPECT_THAT(task.model.actions, ElementsAre("actuator/*"));
  EXPECT_THAT(task.model.quantities, ElementsAre(Pair("x", "body/torso/xpos[0]")));
  const TaskConfig again = RunConfig::FromToml(task.ToToml(), "x.toml").task;
  EXPECT_EQ(again.ToJson(), task.ToJson());
  EXPECT_EQ(again.ToToml(), task.ToToml());
}

TEST(TaskConfig, ABuiltInTaskIsItsName) {
  const TaskConfig task = RunConfig::FromToml("[task]\nname = \"Hopper-v5\"\n", "x.toml").task;
  EXPECT_FALSE(task.has_model());
  EXPECT_EQ(task.Identity(), "Hopper-v5");
  EXPECT_EQ(task.ToJson(), nlohmann::json({{"name", "Hopper-v5"}}));
}

TEST(TaskConfig, PackagesAreNoRelativePaths) {
  const std::string text = "[task]\nmodel = \"package:dm_control/suite/walker.xml\"\n";
  EXPECT_EQ(RunConfig::FromToml(text, "a/x.toml").task.model.model, "package:dm_control/suite/walker.xml");
}

TEST(TaskConfig, ResultsDependOnEveryKeyButTheModelsPlaceAndTheLabel) {
  const nlohmann::json identity = RunConfig::FromToml(kTask, "x.toml").task.Identity();
  std::string text = kTask;
  text.replace(text.find("robots/"), 7, "elsewhere/");
  text.replace(text.find("model"), 0, "name = \"other\"\n");
  EXPECT_EQ(RunConfig::FromToml(text, "x.toml").task.Identity(), identity);
  const std::vector<std::pair<std::string, std::string>> changes = {{"0.02", "0.04"},
                                                                    {"sensor/imu", "sensor/gyro"},
                                                                    {"[-1, 1]", "[-1, 2]"},
                                                                    {"0.1 *", "0.2 *"},
                                                                    {"xpos[0]", "xpos[1]"}};
  for (const auto& [from, to] : changes) {
    std::string changed = kTask;
    changed.replace(changed.find(from), from.size(), to);
    EXPECT_NE(RunConfig::FromToml(changed, "x.toml").task.Identity(), identity) << from;
  }
}

TEST(TaskConfig, MistakesAreErrorsWithFileAndRemedy) {
  const auto refused = [](const std::string& text) {
    return MessageOf<UsageError>([&] { RunConfig::FromToml(text, "mine.toml"); });
  };
  EXPECT_THAT(refused("[task]\nmodel = \"a.xml\"\nobservation = [\"joint/*/qpos\"]\n"),
              AllOf(HasSubstr("mine.toml:3"), HasSubstr("did you mean 'observations'?")));
  EXPECT_THAT(refused("[task]\nmodel = \"a.xml\"\nobservations = \"joint/*/qpos\"\n"),
              AllOf(HasSubstr("mine.toml:3"), HasSubstr("list of texts")));
  EXPECT_THAT(refused("[task]\nmodel = \"a.xml\"\nquantities = 3\n"), HasSubstr("mine.toml:3"));
  EXPECT_THAT(refused("[task]\nmodel = \"a.xml\"\n[task.quantities]\nx = 3\n"),
              AllOf(HasSubstr("mine.toml:4"), HasSubstr("task.quantities.x")));
  EXPECT_THAT(refused("[task]\nname = \"Hopper-v5\"\nreward = \"1\"\n"),
              AllOf(HasSubstr("mine.toml"), HasSubstr("task.reward"), HasSubstr("add model")));
}

TEST(TaskConfig, AnArgumentIsANameOrATomlFile) {
  const TestFolder folder;
  WriteFileAtomically(folder / "mine.toml", kTask);
  EXPECT_EQ(TaskConfig::FromArgument("Hopper-v5").name, "Hopper-v5");
  EXPECT_EQ(TaskConfig::FromArgument(folder / "mine.toml").model.model, folder / "robots/arm.xml");
  WriteFileAtomically(folder / "none.toml", "[run]\nseed = 1\n");
  EXPECT_THAT(MessageOf<UsageError>([&] { TaskConfig::FromArgument(folder / "none.toml"); }), HasSubstr("no [task]"));
}

TEST(TaskRegistry, ARegisteredTaskIsMadeByItsName) {
  EXPECT_EQ(MakeRegisteredTask("Mass-v0", {}), nullptr);
  RegisterTask("Mass-v0", [](const std::vector<ParameterSpec>&) {
    return std::make_unique<PointMassFactory>(PointMassOptions{});
  });
  EXPECT_EQ(MakeSimulatorFactory(TaskConfig::FromArgument("Mass-v0"), {})->spec().task, "PointMass");
}

}  // namespace oted::run_inputs_test
