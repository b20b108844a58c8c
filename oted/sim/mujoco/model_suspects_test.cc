#include "oted/sim/mujoco/model_suspects.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/model_task.h"
#include "oted/sim/mujoco/mujoco_simulator_factory.h"

namespace oted::model_suspects_test {

using testing::Contains;
using testing::ElementsAre;
using testing::Not;

std::vector<std::string> Fields(const std::vector<ParameterSpec>& specs) {
  std::vector<std::string> fields;
  for (const ParameterSpec& spec : specs) fields.push_back(spec.field);
  return fields;
}

/// Of a model where nothing is searched.
std::vector<ParameterSpec> SuspectsOf(const char* mjcf) {
  const TestFolder folder;
  WriteFileAtomically(folder / "model.xml", mjcf);
  return ModelSuspects(*LoadModel(folder / "model.xml").model, ParameterSpace());
}

TEST(ModelSuspects, AreWhatTheModelHasAndNobodySearches) {
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "gravity", .field = "opt/gravity[2]"},
                                                     {.name = "foot", .field = "geom/foot_geom/friction[0]"}});
  const std::vector<std::string> fields = Fields(factory.Suspects());
  EXPECT_THAT(fields, Contains("joint/*/damping"));
  EXPECT_THAT(fields, Contains("body/torso/mass"));
  EXPECT_THAT(fields, Contains("body/torso/mass + body/torso/inertia"));
  EXPECT_THAT(fields, Contains("body/foot/ipos[0] + body/foot/ipos[2]"));
  EXPECT_THAT(fields, Contains("body/foot/ipos[1]"));    // a load on its side: 0, which no multiple moves
  EXPECT_THAT(fields, Contains("body/foot/pos"));        // how long the leg is
  EXPECT_THAT(fields, Not(Contains("body/torso/pos")));  // where the joints say
  EXPECT_THAT(fields, Contains("geom/*/solref[0]"));
  EXPECT_THAT(fields, Contains("opt/gravity[0]"));  // a base or floor that is not level
  EXPECT_THAT(fields, Contains("action/delay"));
  EXPECT_THAT(fields, Contains("obs/thigh_joint_pos/bias"));
  EXPECT_THAT(fields, Contains("joint/@actuated/frictionloss"));  // all of them 0: a value, not a multiple
  EXPECT_THAT(fields, Contains("joint/@actuated/stribeck_torque"));
  EXPECT_THAT(fields, Contains("joint/@actuated/stiffness"));  // all 0 as well
  EXPECT_THAT(fields, Not(Contains("actuator/*/kp")));         // motors
  EXPECT_THAT(fields, Not(Contains("opt/gravity[2]")));        // searched
  EXPECT_THAT(fields, Not(Contains("geom/*/friction[0]")));    // searched in part
}

TEST(ModelSuspects, AreOfDrivesTendonsAndTheMediumWhereTheModelHasThem) {
  const std::vector<std::string> fields = Fields(SuspectsOf(R"(<mujoco>
    <option viscosity="0.1"/>
    <worldbody><body><joint name="fin" axis="0 1 0"/><geom size="0.1 0.1" type="capsule"/></body></worldbody>
    <tendon><fixed name="cord" stiffness="2"><joint joint="fin" coef="1"/></fixed></tendon>
    <actuator><general joint="fin" dyntype="filter" dynprm="0.1"/></actuator>
  </mujoco>)"));
  EXPECT_THAT(fields, Contains("actuator/*/dynprm[0]"));
  EXPECT_THAT(fields, Contains("tendon/*/stiffness"));
  EXPECT_THAT(fields, Contains("tendon/*/damping"));
  EXPECT_THAT(fields, Contains("tendon/*/frictionloss"));  // 0 in the model: a value
  EXPECT_THAT(fields, Contains("opt/viscosity"));
  EXPECT_THAT(fields, Not(Contains("opt/density")));
}

TEST(ModelSuspects, OfWhatTheModelHasNextToNoneOfAreValuesAsIfItHadNone) {
  const auto of = [](double friction, double kv) {
    std::vector<std::string> found;
    const std::string model = fmt::format(R"(<mujoco>
      <worldbody><body><joint name="hip" axis="0 1 0" damping="1" frictionloss="{}"/>
      <geom size="0.1 0.4" type="capsule" pos="0.2 0 0"/></body></worldbody>
      <actuator><position joint="hip" kp="50" kv="{}"/></actuator></mujoco>)",
                                          friction, kv);
    for (const ParameterSpec& spec : SuspectsOf(model.c_str())) {
      if (spec.name == "frictionloss" || spec.name == "kv") {
        EXPECT_TRUE(spec.IsMultiple() || (spec.low == 0 && spec.high > 1)) << spec.field;
        found.push_back(spec.name + (spec.IsMultiple() ? " times" : ""));
      }
    }
    return found;
  };
  EXPECT_THAT(of(0, 0), ElementsAre("frictionloss", "kv"));
  EXPECT_THAT(of(1e-4, 1e-4), ElementsAre("frictionloss", "kv"));
  EXPECT_THAT(of(1, 1), ElementsAre("frictionloss times", "kv times"));
}

TEST(ModelSuspects, AreLoadsBesideTheAxesOfABaseAndOfALastLink) {
  const std::vector<ParameterSpec> suspects = SuspectsOf(R"(<mujoco>
    <worldbody><body name="hull"><freejoint/><geom type="box" size="0.3 0.2 0.1"/>
      <body name="upper"><joint axis="0 1 0"/><geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.4"/>
        <body name="hand" pos="0 0 0.4"><joint axis="0 1 0"/><geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.4"/></body>
      </body></body></worldbody>
  </mujoco>)");
  const std::vector<std::string> fields = Fields(suspects);
  for (const char* axis : {"0", "1", "2"}) EXPECT_THAT(fields, Contains(fmt::format("body/hull/ipos[{}]", axis)));
  EXPECT_THAT(fields, Not(Contains("body/hull/ipos"))) << "there is nothing to multiply";
  EXPECT_THAT(fields, Contains("body/upper/ipos"));
  EXPECT_THAT(fields, Not(Contains("body/upper/ipos[0]"))) << "it carries the hand, which the model knows";
  EXPECT_THAT(fields, Contains("body/hand/ipos[0]"));
  EXPECT_THAT(fields, Contains("body/hand/ipos[2]"));
  const auto hand = std::ranges::find(suspects, "body/hand/ipos[0]", &ParameterSpec::field);
  EXPECT_EQ(hand->scale, ParameterScale::kAbsolute);
  EXPECT_DOUBLE_EQ(hand->high, 0.5) << "its radius of gyration is 0.13 m";
}

TEST(ModelSuspects, AreWhereThingsStandThatTheRobotTouches) {
  const std::vector<ParameterSpec> suspects = SuspectsOf(R"(<mujoco>
    <worldbody><body><joint axis="0 1 0"/><geom size="0.1 0.5" type="capsule"/></body>
    <body name="box" pos="0.4 0 0.25"><geom type="box" size="0.1 0.2 0.05"/></body>
    <geom name="floor" type="plane" size="1 1 1"/></worldbody>
  </mujoco>)");
  EXPECT_THAT(Fields(suspects), Contains("body/box/pos[0]"));
  EXPECT_THAT(Fields(suspects), Contains("geom/floor/pos[2]"));
  EXPECT_THAT(Fields(suspects), Not(Contains("geom/floor/pos[0]"))) << "it has no end";
  const auto height = std::ranges::find(suspects, "body/box/pos[2]", &ParameterSpec::field);
  ASSERT_NE(height, suspects.end());
  EXPECT_EQ(height->nominal, 0.25);
  EXPECT_DOUBLE_EQ(height->high - 0.25, 0.25 - height->low) << "above or below";
}

TEST(ModelSuspects, AreAllNumbersOfAThrustersGearAndAllMassesAtOnce) {
  const std::vector<std::string> fields = Fields(SuspectsOf(R"(<mujoco>
    <worldbody><body name="frame"><freejoint/><geom size="0.1"/><site name="rotor"/>
    <body name="camera"><geom size="0.02"/></body></body></worldbody>
    <actuator><motor site="rotor" gear="0 0 2 0 0 0.1"/></actuator>
  </mujoco>)"));
  EXPECT_THAT(fields, Contains("actuator/*/gear"));
  EXPECT_THAT(fields, Contains("body/*/mass + body/*/inertia"));
  EXPECT_THAT(fields, Contains("body/frame/mass"));
}

TEST(ModelSuspects, AreLimitsOfForcesAndHowSoftAnEqualityIs) {
  const std::vector<std::string> fields = Fields(SuspectsOf(R"(<mujoco>
    <worldbody><body><joint name="left" actuatorfrcrange="-3 3"/><geom size="0.1"/></body>
    <body><joint name="right"/><geom size="0.1"/></body></worldbody>
    <equality><joint joint1="left" joint2="right"/></equality>
    <actuator><motor joint="left" forcerange="-2 2"/></actuator>
  </mujoco>)"));
  EXPECT_THAT(fields, Contains("actuator/*/forcerange"));
  EXPECT_THAT(fields, Contains("joint/*/actfrcrange"));
  EXPECT_THAT(fields, Contains("equality/*/solref[0]"));
  EXPECT_THAT(fields, Contains("equality/*/solref[1]"));
  const MujocoSimulatorFactory hopper("Hopper-v5", {});
  EXPECT_THAT(Fields(hopper.Suspects()), Not(Contains("actuator/*/forcerange"))) << "its motors have none";
}

TEST(ModelSuspects, AreForcesAtWhichDrivesMaySaturateWhoseModelHasNoLimit) {
  const std::vector<ParameterSpec> suspects = SuspectsOf(R"(<mujoco>
    <worldbody><body><joint name="left"/><geom size="0.1"/></body>
    <body><joint name="right"/><geom size="0.1"/></body></worldbody>
    <actuator><motor name="left" joint="left" ctrlrange="-3 3"/>
    <motor name="right" joint="right" ctrlrange="-3 3" forcerange="-2 2"/></actuator>
  </mujoco>)");
  const auto left = std::ranges::find(suspects, "actuator/left/force_limit", &ParameterSpec::field);
  ASSERT_NE(left, suspects.end());
  EXPECT_EQ(left->nominal, 300) << "never reached";
  EXPECT_EQ(left->unit, "N m");
  EXPECT_LT(left->low, 0.1);
  const auto right = std::ranges::find(suspects, "actuator/right/force_limit", &ParameterSpec::field);
  ASSERT_NE(right, suspects.end());
  EXPECT_EQ(right->nominal, 2);
}

TEST(ModelSuspects, AreWhereSpringsRest) {
  const std::vector<ParameterSpec> suspects = SuspectsOf(R"(<mujoco><compiler angle="radian"/>
    <worldbody><body><joint name="hip" stiffness="2" springref="0.3"/><geom size="0.1"/>
    <body><joint name="knee"/><geom size="0.1"/></body></body></worldbody>
  </mujoco>)");
  EXPECT_THAT(Fields(suspects), Not(Contains("joint/knee/springref")));
  const auto hip = std::ranges::find(suspects, "joint/hip/springref", &ParameterSpec::field);
  ASSERT_NE(hip, suspects.end());
  EXPECT_DOUBLE_EQ(hip->nominal, 0.3);
  EXPECT_DOUBLE_EQ(hip->low, -0.7);
  EXPECT_DOUBLE_EQ(hip->high, 1.3);
}

TEST(ModelSuspects, AreHowLongTendonsSpringsRest) {
  const std::vector<ParameterSpec> suspects = SuspectsOf(R"(<mujoco>
    <worldbody><site name="a"/><body pos="0 0 0.5"><joint/><geom size="0.1"/><site name="b"/></body></worldbody>
    <tendon>
      <spatial name="cable" stiffness="50" springlength="0.4"><site site="a"/><site site="b"/></spatial>
      <spatial name="slack" stiffness="50" springlength="0.3 0.4"><site site="a"/><site site="b"/></spatial>
      <spatial name="limp"><site site="a"/><site site="b"/></spatial>
    </tendon></mujoco>)");
  EXPECT_THAT(Fields(suspects), Not(Contains("tendon/slack/lengthspring"))) << "it has two";
  EXPECT_THAT(Fields(suspects), Not(Contains("tendon/limp/lengthspring")));
  const auto cable = std::ranges::find(suspects, "tendon/cable/lengthspring", &ParameterSpec::field);
  ASSERT_NE(cable, suspects.end());
  EXPECT_DOUBLE_EQ(cable->nominal, 0.4);
  EXPECT_LT(cable->low, 0.3);
  EXPECT_GT(cable->high, 0.5);
}

TEST(ModelSuspects, AreOfTheOtherJointsWhereOneIsSearched) {
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "knee", .field = "joint/leg_joint/damping"}});
  const std::vector<std::string> fields = Fields(factory.Suspects());
  EXPECT_THAT(fields, Contains("joint/thigh_joint/damping"));
  EXPECT_THAT(fields, Contains("joint/foot_joint/damping"));
  EXPECT_THAT(fields, Not(Contains("joint/leg_joint/damping")));
  EXPECT_THAT(fields, Not(Contains("joint/*/damping")));
  EXPECT_THAT(fields, Contains("joint/*/armature")) << "of which none is searched";
}

const ParameterSpec* With(const std::vector<ParameterSpec>& specs, const std::string& field) {
  const auto found = std::ranges::find(specs, field, &ParameterSpec::field);
  return found == specs.end() ? nullptr : &*found;
}

TEST(ModelSuspects, OfWhatIsSearchedOfAllJointsEachAloneMultipliesWhatThatGives) {
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "all", .field = "joint/*/damping"}});
  const std::vector<ParameterSpec> suspects = factory.Suspects();
  EXPECT_EQ(With(suspects, "joint/*/damping"), nullptr);
  const ParameterSpec* knee = With(suspects, "joint/leg_joint/damping");
  ASSERT_NE(knee, nullptr);
  EXPECT_EQ(knee->unit, "x all");
  EXPECT_EQ(factory.With({*knee})->parameters()[1].unit, "x all");
  EXPECT_EQ(With(suspects, "joint/*/armature")->unit, "x nominal");
  const MujocoSimulatorFactory values("Hopper-v5", {{.name = "all",
                                                     .field = "joint/@actuated/frictionloss",
                                                     .low = 0,
                                                     .high = 2,
                                                     .scale = ParameterScale::kAbsolute}});
  EXPECT_EQ(With(values.Suspects(), "joint/leg_joint/frictionloss"), nullptr) << "a value is not to be multiplied";
}

TEST(ModelSuspects, HaveNamesThatDifferWhereThoseOfTheModelHardlyDo) {
  const TestFolder folder;
  WriteFileAtomically(folder / "names.xml", R"(<mujoco>
    <worldbody><body><joint name="j 1" axis="0 1 0" damping="1"/><geom size="0.1 0.1" type="capsule"/>
      <body name="body1" pos="0 0 1"><joint name="j_1" axis="0 1 0" damping="1"/><geom size="0.1 0.1" type="capsule"/>
        <body name="腰" pos="0 0 1"><joint name="a_tendon" axis="0 1 0" damping="1"/><geom size="0.1 0.1" type="capsule"/>
    </body></body></body></worldbody>
    <tendon><fixed name="a" damping="1"><joint joint="j_1" coef="1"/></fixed></tendon>
    <actuator><motor joint="j 1" ctrlrange="-1 1"/></actuator>
  </mujoco>)");
  ModelTask task;
  task.name = "names";
  task.model = folder / "names.xml";
  task.control_period = 0.01;
  task.observations = {"joint/*/qpos", "joint/*/qvel"};
  task.actions = {"actuator/*"};
  const MujocoSimulatorFactory factory(task, {});
  EXPECT_NE(factory.With(factory.Suspects()), nullptr);
}

TEST(ModelSuspects, OneThatSharesSomeNumbersWithWhatIsSearchedIsNoPartOfIt) {
  const auto units = [](const std::string& one, const std::string& other) {
    const MujocoSimulatorFactory factory("Hopper-v5",
                                         {{.name = "one", .field = one}, {.name = "other", .field = other}});
    return std::vector{factory.parameters()[0].unit, factory.parameters()[1].unit};
  };
  const std::string knee = "joint/leg_joint/damping", hip = "joint/thigh_joint/damping",
                    foot = "joint/foot_joint/damping";
  EXPECT_THAT(units("joint/*/damping", knee), ElementsAre("x nominal", "x one"));
  EXPECT_THAT(units(knee, "joint/*/damping"), ElementsAre("x other", "x nominal"));
  EXPECT_THAT(units(knee + " + " + hip, knee + " + " + foot), ElementsAre("x nominal", "x nominal"));
  EXPECT_THAT(units(knee, knee), ElementsAre("x nominal", "x one"));
}

TEST(ModelSuspects, HavePartsWhereTheyAreOfSeveralObjects) {
  const MujocoSimulatorFactory factory("Hopper-v5", {});
  const std::vector<ParameterSpec> suspects = factory.Suspects();
  const auto parts = [&](const std::string& field) { return Fields(factory.PartsOf(*With(suspects, field))); };
  EXPECT_THAT(
      parts("joint/@actuated/frictionloss"),
      ElementsAre("joint/thigh_joint/frictionloss", "joint/leg_joint/frictionloss", "joint/foot_joint/frictionloss"));
  EXPECT_THAT(parts("joint/*/damping"), Contains("joint/leg_joint/damping"));
  EXPECT_THAT(parts("body/*/inertia"), Contains("body/thigh/inertia"));
  EXPECT_THAT(parts("body/thigh/mass + body/thigh/inertia"), ElementsAre());
  EXPECT_THAT(parts("opt/gravity[2]"), ElementsAre());
  EXPECT_THAT(parts("action/delay"),
              ElementsAre("action/thigh_joint/delay", "action/leg_joint/delay", "action/foot_joint/delay"));
}

TEST(ModelSuspects, StandBehindTheParametersOfTheSameSimulator) {
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "gain", .field = "actuator/*/gainprm[0]"}});
  const std::vector<ParameterSpec> suspects = factory.Suspects();
  const auto wider = factory.With(suspects);
  ASSERT_EQ(wider->parameters().size(), 1 + static_cast<int>(suspects.size()));
  EXPECT_EQ(wider->parameters()[0].name, "gain");
  EXPECT_EQ(wider->parameters()[1].field, suspects[0].field);
  std::vector<double> nominal = {1.0};
  for (const ParameterSpec& suspect : suspects) {
    const bool is_limit = suspect.field.ends_with("/force_limit");  // of motors from -1 to 1
    EXPECT_EQ(suspect.nominal, is_limit ? 100.0 : suspect.IsMultiple() ? 1.0 : 0.0) << suspect.field;
    nominal.push_back(suspect.nominal);
  }
  EXPECT_EQ(wider->parameters().Nominal(), nominal);
}

TEST(ModelSuspects, HaveNamesOfTheirOwnAndLeaveOutWhatIsSearchedAroundTheModel) {
  const std::vector<ParameterSpec> searched = {
      {.name = "damping", .field = "opt/gravity[2]"},
      {.name = "lag", .field = "action/delay", .low = 0, .high = 2, .scale = ParameterScale::kAbsolute}};
  const auto factory = MujocoSimulatorFactory("Hopper-v5", {}).With(searched);
  const std::vector<ParameterSpec> suspects = factory->Suspects();
  EXPECT_THAT(Fields(suspects), Contains("joint/*/damping"));
  EXPECT_THAT(Fields(suspects), Not(Contains("action/delay")));
  for (const ParameterSpec& suspect : suspects) {
    EXPECT_NE(suspect.name, "damping");
    EXPECT_NE(factory->With({suspect}), nullptr) << suspect.field;
  }
}

}  // namespace oted::model_suspects_test
