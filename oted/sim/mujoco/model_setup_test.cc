// Task files that are wrong: one line that names the key, what it got and the remedy.

#include "oted/sim/mujoco/model_setup.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "oted/base/error.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"
#include "oted/sim/mujoco/testing.h"

namespace oted::model_setup_test {

using testing::AllOf;
using testing::HasSubstr;

class ModelSetup : public testing::Test {
 protected:
  // The message for the crawler after `change`.
  template <class E = UsageError>
  std::string Refused(const std::function<void(ModelTask&)>& change) {
    ModelTask task = CrawlerTask(folder_);
    change(task);
    return MessageOf<E>([&] { MujocoSimulatorFactory(task, {}); });
  }
  TestFolder folder_;
};

TEST_F(ModelSetup, AnUnknownObjectIsNamedWithTheNearestAndTheModel) {
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations.emplace_back("sensor/gyra"); }),
              AllOf(HasSubstr("task.observations 'sensor/gyra'"), HasSubstr("crawler.xml"),
                    HasSubstr("did you mean 'gyro'?"), HasSubstr("touch")));
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations = {"joint/hop/qpos"}; }), HasSubstr("did you mean 'hip'?"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.actions = {"actuator/knee"}; }),
              AllOf(HasSubstr("task.actions 'actuator/knee'"), HasSubstr("there are hip, wrist, line")));
  EXPECT_THAT(Refused([](ModelTask& t) { t.start = "keyframe/home"; }),
              AllOf(HasSubstr("task.start"), HasSubstr("there are ready")));
}

TEST_F(ModelSetup, AnUnknownOwnerFieldOrIndexIsNamedWithThoseThatThereAre) {
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations = {"jont/*/qpos"}; }), HasSubstr("did you mean 'joint'?"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations = {"joint"}; }), HasSubstr("names no joint"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations = {"site/tip"}; }), HasSubstr("xpos, xquat"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations = {"site/tip/pos"}; }), HasSubstr("did you mean 'xpos'?"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations = {"site/tip/xpos[3]"}; }), HasSubstr("wanted 0 to 2"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations = {"sensor/gyro[3]"}; }), HasSubstr("wanted 0 to 2"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations = {"actuator/hip/act"}; }), HasSubstr("has a 'act'"));
  EXPECT_THAT(Refused([](ModelTask& t) {
                t.observations = {"joint/*/qpos", "joint/hip/qpos"};
              }),
              HasSubstr("'joint/hip/qpos' is observed twice"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations.clear(); }), HasSubstr("task.observations is empty"));
}

TEST_F(ModelSetup, AControlPeriodIsAMultipleOfTheTimeStep) {
  EXPECT_THAT(Refused([](ModelTask& t) { t.control_period = 0.0215; }),
              AllOf(HasSubstr("task.control_period is 0.0215"), HasSubstr("0.004"), HasSubstr("nearest is 0.02 s")));
  EXPECT_THAT(Refused([](ModelTask& t) { t.control_period = 0.001; }), HasSubstr("nearest is 0.004 s"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.control_period = 0; }), HasSubstr("task.control_period is missing, or 0"));
}

TEST_F(ModelSetup, AControlWithoutARangeNeedsOne) {
  std::string xml = kCrawlerXml;
  const std::string range = R"( ctrlrange="-1 1" ctrllimited="true")";
  xml.erase(xml.find(range), range.size());
  const auto change = [&](ModelTask& t) { WriteFileAtomically(t.model, xml); };
  EXPECT_THAT(Refused(change), AllOf(HasSubstr("'actuator/hip' has no ctrlrange"), HasSubstr("task.action_range")));
  ModelTask task = CrawlerTask(folder_);
  change(task);
  task.action_range = {-0.5, 0.5};
  const MujocoSimulatorFactory factory(task, {});
  EXPECT_EQ(factory.spec().action_low, (std::vector{-0.5, -2.0, -0.2})) << "only where the model gives none";
  EXPECT_THAT(Refused([](ModelTask& t) { t.action_range = {1, -1}; }), HasSubstr("low < high"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.action_range = {-1, INFINITY}; }), HasSubstr("both within +-1e+10"));
  xml = kCrawlerXml;
  xml.replace(xml.find(range), range.size(), R"( ctrlrange="-inf inf" ctrllimited="true")");
  EXPECT_THAT(Refused<DataError>(change),
              AllOf(HasSubstr("the ctrlrange of 'actuator/hip' is -inf to inf"), HasSubstr("within +-1e+10")));
}

TEST_F(ModelSetup, AModelWithoutActuatorsNeedsMotors) {
  std::string xml = kCrawlerXml;
  const size_t begin = xml.find("<actuator>"), end = xml.find("</actuator>") + 11;
  xml.erase(begin, end - begin);
  xml.replace(xml.find(" ctrl=\"0.1 0 0.05\""), 18, "");
  const auto bare = [&](ModelTask& t) {
    WriteFileAtomically(t.model, xml);
    std::erase(t.observations, "actuator/*/act");
  };
  EXPECT_THAT(Refused(bare), AllOf(HasSubstr("no actuators"), HasSubstr("task.motors")));
  EXPECT_THAT(Refused([&](ModelTask& t) { bare(t), t.motors = {"joint/hip"}; }),
              AllOf(HasSubstr("joint 'hip' has no force limit"), HasSubstr("task.action_range")));
  EXPECT_THAT(Refused([&](ModelTask& t) { bare(t), t.motors = {"joint/neck"}; }), HasSubstr("neither hinge nor slide"));
  EXPECT_THAT(Refused([&](ModelTask& t) { bare(t), t.motors = {"joint/hips"}; }), HasSubstr("did you mean 'hip'?"));
}

TEST_F(ModelSetup, MistakesInExpressionsAreShownWithTheNamesThatThereAre) {
  EXPECT_THAT(Refused([](ModelTask& t) { t.reward = "d_torso[0] - sum2_acton"; }),
              AllOf(HasSubstr("task.reward \"d_torso[0] - sum2_acton\""), HasSubstr("unknown name 'sum2_acton'"),
                    HasSubstr("did you mean 'sum2_action'?"), HasSubstr("d_hip")));
  EXPECT_THAT(Refused([](ModelTask& t) { t.terminate = "hip >"; }), HasSubstr("task.terminate"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.terminate = "hip = 2"; }), HasSubstr("compare with =="));
  EXPECT_THAT(Refused([](ModelTask& t) { t.quantities["d_hip"] = "joint/wrist/qpos"; }),
              AllOf(HasSubstr("'d_hip'"), HasSubstr("rename")));
  EXPECT_THAT(Refused([](ModelTask& t) { t.quantities["sin"] = "joint/wrist/qpos"; }), HasSubstr("'sin'"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.quantities["2nd"] = "joint/wrist/qpos"; }), HasSubstr("is no name"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.quantities["tip"] = "site/top/xpos"; }),
              AllOf(HasSubstr("task.quantities.tip"), HasSubstr("did you mean 'tip'?")));
}

TEST_F(ModelSetup, AnExpressionWithoutAFiniteValueIsAnErrorWithTheNumbers) {
  EXPECT_THAT(Refused<DataError>([](ModelTask& t) { t.reward = "log(-torso[2])"; }),
              AllOf(HasSubstr("task.reward"), HasSubstr("nan"), HasSubstr("torso[2] = 0.3"), HasSubstr("guard it")));
}

TEST_F(ModelSetup, AnEpisodeThatEndsAtOnceIsAnError) {
  EXPECT_THAT(Refused([](ModelTask& t) { t.terminate = "torso[2] < 1"; }),
              AllOf(HasSubstr("task.terminate"), HasSubstr("torso[2] < 1"), HasSubstr("task.start")));
}

TEST_F(ModelSetup, WhatIsUnobservedMayNotMatter) {
  EXPECT_THAT(Refused([](ModelTask& t) {
                std::erase(t.observations, "joint/root/qpos[2]");
                t.unobserved.emplace_back("joint/root/qpos[2]");
              }),
              AllOf(HasSubstr("task.unobserved lists 'joint/root/qpos[2]'"), HasSubstr("observe it")));
  EXPECT_THAT(Refused([](ModelTask& t) { t.observations.emplace_back("body/torso/xpos[0]"); }),
              AllOf(HasSubstr("'joint/root/qpos[0]'"), HasSubstr("'body/torso/xpos[0]'")));
  EXPECT_THAT(Refused([](ModelTask& t) { t.unobserved.emplace_back("joint/hip/qvel"); }), HasSubstr("is observed"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.unobserved = {"site/tip/xpos"}; }), HasSubstr("coordinate of the state"));
}

TEST_F(ModelSetup, BadStartsAreErrors) {
  EXPECT_THAT(Refused([](ModelTask& t) { t.start = "home"; }), HasSubstr("default, keyframe/NAME or logs"));
  EXPECT_THAT(Refused([](ModelTask& t) { t.start = "logs"; }), HasSubstr("there are none here"));
  EXPECT_THAT(Refused([](ModelTask& t) {
                t.start_qpos = {1, 2};
              }),
              AllOf(HasSubstr("has 2 numbers, wanted 14"), HasSubstr("joint/neck/qpos[3]")));
  ModelTask task = CrawlerTask(folder_);
  task.start = "logs";
  Array2<double> zeros(2, 29);
  EXPECT_THAT(MessageOf<DataError>([&] { MujocoSimulatorFactory(task, {}, zeros); }), HasSubstr("task.start"));
}

TEST_F(ModelSetup, MissingAndBrokenModelsAreErrorsWithTheirPath) {
  EXPECT_THAT(Refused<DataError>([](ModelTask& t) { t.model = "no/such.xml"; }),
              AllOf(HasSubstr("no/such.xml"), HasSubstr("folder of the task file")));
  EXPECT_THAT(Refused<DataError>([](ModelTask& t) { t.model = "package:nobody/robot.xml"; }),
              AllOf(HasSubstr("nobody/robot.xml"), HasSubstr("OTED_PACKAGES")));
  EXPECT_THAT(Refused<DataError>([](ModelTask& t) { WriteFileAtomically(t.model, "<mujoco><worldbod/></mujoco>"); }),
              AllOf(HasSubstr("crawler.xml"), HasSubstr("worldbod")));
}

TEST_F(ModelSetup, MeshesAndIncludesAreFoundBesideTheModel) {
  std::string xml = kCrawlerXml;
  const size_t begin = xml.find("<sensor>"), end = xml.find("</sensor>") + 9;
  WriteFileAtomically(folder_ / "parts/sensors.xml", "<mujoco>" + xml.substr(begin, end - begin) + "</mujoco>");
  xml.replace(begin, end - begin, "<include file=\"parts/sensors.xml\"/>");
  ModelTask task = CrawlerTask(folder_);
  const MujocoSimulatorFactory whole(task, {});
  WriteFileAtomically(task.model, xml);
  EXPECT_EQ(MujocoSimulatorFactory(task, {}).model_sha256(), whole.model_sha256());
}

TEST_F(ModelSetup, TheHashIsThatOfTheCompiledModelWhereverItLies) {
  const TestFolder elsewhere;
  const ModelTask task = CrawlerTask(folder_);
  const MujocoSimulatorFactory here(task, {}), there(CrawlerTask(elsewhere), {});
  EXPECT_EQ(here.model_sha256(), there.model_sha256());
  EXPECT_EQ(Sha256(CompileToMjb(task)), here.model_sha256());
  std::string xml = kCrawlerXml;
  xml.replace(xml.find("kp=\"3\""), 6, "kp=\"4\"");
  WriteFileAtomically(task.model, xml);
  EXPECT_NE(MujocoSimulatorFactory(task, {}).model_sha256(), here.model_sha256());
}

}  // namespace oted::model_setup_test
