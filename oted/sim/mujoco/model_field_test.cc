#include "oted/sim/mujoco/model_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/base/testing.h"
#include "oted/sim/mujoco/drive_kind.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/task.h"

namespace oted::model_field_test {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;
using testing::ThrowsMessage;

class ModelFieldTest : public testing::Test {
 protected:
  void SetUp() override { loaded_ = LoadModel(AssetFolder() / "hopper.xml"); }
  ModelField Resolve(const std::string& path) const {
    const std::vector<ModelField> fields = ResolvePath(*loaded_.model, path);
    EXPECT_EQ(fields.size(), 1u);
    return fields.front();
  }
  LoadedModel loaded_;
};

TEST_F(ModelFieldTest, AGlobSharesOneNumberOfEveryObject) {
  const ModelField field = Resolve("geom/*/friction[0]");
  EXPECT_EQ(field.array, "geom_friction");
  EXPECT_THAT(field.indices, ElementsAre(0, 3, 6, 9, 12));
  EXPECT_THAT(field.nominal, ElementsAre(1.0, 0.9, 0.9, 0.9, 2.0));
  EXPECT_FALSE(field.changes_constants);
}

TEST_F(ModelFieldTest, NamesAndIdsAndWildcardsPickObjects) {
  EXPECT_THAT(Resolve("geom/foot_geom/friction[0]").indices, ElementsAre(12));
  EXPECT_THAT(Resolve("geom/#4/friction[0]").indices, ElementsAre(12));
  EXPECT_THAT(Resolve("geom/t*_geom/friction[0]").indices, ElementsAre(3, 6));
  EXPECT_THAT(Resolve("geom/le?_geom/friction[0]").indices, ElementsAre(9));
  EXPECT_THAT(Resolve("body/torso/mass").indices, ElementsAre(1));
}

TEST_F(ModelFieldTest, UnnamedObjectsMatchAStarAndTheirId) {
  // Hopper's three motors have no names.
  EXPECT_THAT(Resolve("actuator/*/gainprm[0]").nominal, ElementsAre(1, 1, 1));
  EXPECT_THAT(Resolve("actuator/#2/gear[0]").nominal, ElementsAre(200));
}

TEST_F(ModelFieldTest, AMissingIndexAndAStarMeanAllNumbers) {
  EXPECT_THAT(Resolve("geom/foot_geom/friction").indices, ElementsAre(12, 13, 14));
  EXPECT_THAT(Resolve("geom/foot_geom/friction[*]").indices, ElementsAre(12, 13, 14));
  EXPECT_THAT(Resolve("body/*/inertia").indices, SizeIs(15));
}

TEST_F(ModelFieldTest, AJointOwnsWhatMuJoCoStoresPerDegreeOfFreedom) {
  EXPECT_EQ(Resolve("joint/*/damping").array, "dof_damping");
  EXPECT_THAT(Resolve("joint/*/damping").nominal, ElementsAre(0, 0, 0, 1, 1, 1));
  EXPECT_THAT(Resolve("joint/foot_joint/armature").indices, ElementsAre(5));
  EXPECT_EQ(Resolve("joint/*/frictionloss").array, "dof_frictionloss");
  EXPECT_EQ(Resolve("joint/*/stiffness").array, "jnt_stiffness");
}

TEST_F(ModelFieldTest, OptionsHaveNoObjects) {
  const ModelField field = Resolve("opt/gravity[2]");
  EXPECT_EQ(field.array, "opt.gravity");
  EXPECT_THAT(field.indices, ElementsAre(2));
  EXPECT_THAT(field.nominal, ElementsAre(-9.81));
  EXPECT_EQ(field.unit, "m/s^2");
  EXPECT_THAT(Resolve("opt/viscosity").indices, ElementsAre(0));
}

TEST(ModelFieldUnits, ATendonWithAHingeInItHasThoseOfAnAngle) {
  const TestFolder folder;
  WriteFileAtomically(folder / "two.xml", R"(<mujoco>
    <worldbody><body><joint name="x" type="slide" axis="1 0 0"/><geom size="0.1"/>
      <body><joint name="pitch"/><geom size="0.1"/></body></body></worldbody>
    <tendon>
      <fixed name="wheels"><joint joint="x" coef="20"/><joint joint="pitch" coef="-1"/></fixed>
      <fixed name="rail"><joint joint="x" coef="1"/></fixed>
    </tendon>
  </mujoco>)");
  const LoadedModel loaded = LoadModel(folder / "two.xml");
  EXPECT_EQ(ResolvePath(*loaded.model, "tendon/wheels/frictionloss").front().unit, "N m");
  EXPECT_EQ(ResolvePath(*loaded.model, "tendon/wheels/damping").front().unit, "N m s/rad");
  EXPECT_EQ(ResolvePath(*loaded.model, "tendon/rail/frictionloss").front().unit, "N");
  EXPECT_EQ(ResolvePath(*loaded.model, "tendon/*/frictionloss").front().unit, "N | N m");
}

TEST_F(ModelFieldTest, MassesAndInertiasAndGearsNeedFreshConstants) {
  for (const char* path : {"body/*/mass", "body/*/inertia", "joint/*/armature", "actuator/*/gear[0]"}) {
    EXPECT_TRUE(Resolve(path).changes_constants) << path;
  }
  for (const char* path : {"opt/gravity[2]", "actuator/*/gainprm[0]", "joint/*/damping", "joint/*/stiffness"}) {
    EXPECT_FALSE(Resolve(path).changes_constants) << path;
  }
}

TEST_F(ModelFieldTest, AnErrorNamesThePartThatMatchesNothingAndTheNearestName) {
  const auto message = [&](const std::string& path, auto matcher) {
    EXPECT_THAT([&] { Resolve(path); }, ThrowsMessage<UsageError>(AllOf(HasSubstr("'" + path + "'"), matcher))) << path;
  };
  message("geom/*/fricton[0]", HasSubstr("did you mean 'friction'"));
  message("geom/foot_gem/friction[0]", HasSubstr("did you mean 'foot_geom'"));
  message("goem/*/friction[0]", HasSubstr("did you mean 'geom'"));
  message("opt/gravty[2]", HasSubstr("did you mean 'gravity'"));
  message("geom/*/friction[3]", HasSubstr("wanted 0 to 2"));
  message("geom/*/friction[x]", HasSubstr("got index 'x'"));
  message("geom/*/friction[0", HasSubstr("']'"));
  message("geom/friction[0]", HasSubstr("geom/*/friction[0]"));
  message("friction", HasSubstr("wanted owner/objects/field"));
  message("geom/*/", HasSubstr("wanted owner/objects/field"));
  message("tendon/*/stiffness", HasSubstr("there are none"));
  message("geom/#5/friction[0]", HasSubstr("no geom matches '#5'"));
}

TEST_F(ModelFieldTest, DerivedConstantsAndTheTimeStepAreNotParameters) {
  for (const char* path : {"body/*/subtreemass", "geom/*/rbound", "joint/*/M0", "opt/timestep", "geom/*/type"}) {
    EXPECT_THROW(Resolve(path), UsageError) << path;
  }
}

TEST_F(ModelFieldTest, AMultipleOfZeroIsAnErrorThatNamesTheRemedy) {
  ParameterSpec spec{.name = "wind", .field = "opt/wind[0]"};
  EXPECT_THAT([&] { ResolveParameter(*loaded_.model, spec); }, ThrowsMessage<UsageError>(HasSubstr("absolute")));
  spec.scale = ParameterScale::kAbsolute;
  EXPECT_EQ(ResolveParameter(*loaded_.model, spec).front().nominal, std::vector{0.0});
  EXPECT_EQ(spec.nominal, 0);
  EXPECT_EQ(spec.unit, "m/s");
}

TEST_F(ModelFieldTest, OneAbsoluteValueForPlacesThatDifferIsAnError) {
  ParameterSpec spec{.name = "friction", .field = "geom/*/friction[0]", .scale = ParameterScale::kAbsolute};
  EXPECT_THAT([&] { ResolveParameter(*loaded_.model, spec); }, ThrowsMessage<UsageError>(HasSubstr("from 0.9 to 2")));
}

TEST_F(ModelFieldTest, WhatNoBodyHasLessThanNothingOfHasNoNegativeRange) {
  ParameterSpec spec{.name = "mass", .field = "body/torso/mass", .low = -1, .scale = ParameterScale::kAbsolute};
  EXPECT_THAT([&] { ResolveParameter(*loaded_.model, spec); },
              ThrowsMessage<UsageError>(testing::AllOf(HasSubstr("'mass'"), HasSubstr("-1"), HasSubstr("negative"))));
  spec.is_known = true;
  ResolveParameter(*loaded_.model, spec);
}

TEST_F(ModelFieldTest, AParameterFileOfAnotherModelIsRefused) {
  ParameterSpec spec{.name = "gravity", .field = "opt/gravity[2]", .low = -20, .high = -1};
  spec.scale = ParameterScale::kAbsolute;
  spec.wanted_nominal = -9.81;
  ResolveParameter(*loaded_.model, spec);
  EXPECT_EQ(spec.nominal, -9.81);
  spec.wanted_nominal = -9.8;
  EXPECT_THAT(
      [&] { ResolveParameter(*loaded_.model, spec); },
      ThrowsMessage<UsageError>(testing::AllOf(HasSubstr("'gravity'"), HasSubstr("-9.8 in the parameter file"))));
}

LoadedModel Compiled(const std::string& name, const std::string& body, const std::string& actuators) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / ("oted_" + name + ".xml");
  std::ofstream(path) << "<mujoco><worldbody><body name=\"link\"><joint name=\"j\"/>" << body
                      << "</body></worldbody><actuator>" << actuators << "</actuator></mujoco>";
  return LoadModel(path);
}

/// Writes a parameter's value as the simulator does.
void Write(mjModel& model, ParameterSpec spec, double z) {
  for (const ModelField& field : ResolveParameter(model, spec)) {
    double* values = field.array == "actuator_gainprm"   ? model.actuator_gainprm
                     : field.array == "actuator_biasprm" ? model.actuator_biasprm
                     : field.array == "body_mass"        ? model.body_mass
                                                         : model.body_inertia;
    for (size_t k = 0; k < field.indices.size(); ++k) {
      values[field.indices[k]] = spec.scale == ParameterScale::kNominal ? z * field.nominal[k] : z * field.sign;
    }
  }
}

std::vector<double> Gains(const mjModel& model) {
  std::vector<double> all(model.actuator_gainprm, model.actuator_gainprm + model.nactuator * mjNGAIN);
  all.insert(all.end(), model.actuator_biasprm, model.actuator_biasprm + model.nactuator * mjNBIAS);
  return all;
}

constexpr const char* kBall = "<geom size=\".1\"/>";

TEST(Servos, StiffnessAndDampingAreWhatMujocosCompilerMakesOfThem) {
  const auto with = [](const std::string& name, double kp, double kv, double velocity) {
    std::ostringstream actuators;
    actuators << "<position joint=\"j\" kp=\"" << kp << "\" kv=\"" << kv << "\"/><motor joint=\"j\" gear=\"3\"/>"
              << "<velocity joint=\"j\" kv=\"" << velocity << "\"/>";
    return Compiled(name, kBall, actuators.str());
  };
  const LoadedModel nominal = with("servos", 100, 4, 6), stiffer = with("stiffer", 150, 4, 6);
  const LoadedModel damped = with("damped", 100, 2, 3), alike = with("alike", 100, 5, 5);
  LoadedModel model = with("servos", 100, 4, 6);
  Write(*model.model, {.name = "kp", .field = "actuator/*/kp"}, 1.5);
  EXPECT_EQ(Gains(*model.model), Gains(*stiffer.model));
  model = with("servos", 100, 4, 6);
  Write(*model.model,
        {.name = "kp", .field = "actuator/#0/kp", .low = 1, .high = 200, .scale = ParameterScale::kAbsolute}, 150);
  EXPECT_EQ(Gains(*model.model), Gains(*stiffer.model));
  model = with("servos", 100, 4, 6);
  Write(*model.model, {.name = "kv", .field = "actuator/*/kv"}, 0.5);
  EXPECT_EQ(Gains(*model.model), Gains(*damped.model));
  EXPECT_THROW(Write(*model.model, {.name = "kv", .field = "actuator/*/kv", .scale = ParameterScale::kAbsolute}, 5),
               UsageError)
      << "the two servos differ";
  model = with("equal", 100, 5.5, 5.5);
  Write(*model.model, {.name = "kv", .field = "actuator/*/kv", .scale = ParameterScale::kAbsolute}, 5);
  EXPECT_EQ(Gains(*model.model), Gains(*alike.model));
  EXPECT_THAT([&] { ResolvePath(*nominal.model, "actuator/#1/kp"); },
              ThrowsMessage<UsageError>(HasSubstr("no such actuator is a position servo")));
  EXPECT_THROW(ResolvePath(*nominal.model, "actuator/#2/kp"), UsageError) << "a velocity servo has none";
}

TEST(Servos, AMotorsBackEmfIsItsKvAndItsGainStaysApart) {
  const auto with = [](const std::string& name, double back_emf) {
    return Compiled(name, kBall,
                    fmt::format(R"(<general joint="j" gainprm="0.6" biastype="affine" biasprm="0 0 -{}"/>
      <position joint="j" kp="9" kv="1"/><motor joint="j"/>)",
                                back_emf));
  };
  LoadedModel model = with("motor", 0.5);
  EXPECT_EQ(DriveOf(*model.model, 0), DriveKind::kMotor);
  const LoadedModel stronger = with("stronger", 0.75);
  Write(*model.model, {.name = "back_emf", .field = "actuator/#0/kv"}, 1.5);
  EXPECT_EQ(Gains(*model.model), Gains(*stronger.model));
  EXPECT_EQ(ResolvePath(*model.model, "actuator/*/kv")[0].indices.size(), 2u) << "its own and the servo's";
  EXPECT_THROW(ResolvePath(*model.model, "actuator/#2/kv"), UsageError) << "a motor without";
  EXPECT_THROW(ResolvePath(*model.model, "actuator/#0/kp"), UsageError);
}

TEST(SpringReference, IsWhereMujocosCompilerPutsTheRestOfASpring) {
  const std::filesystem::path file = std::filesystem::path(testing::TempDir()) / "oted_springs.xml";
  std::ofstream(file) << R"(<mujoco><compiler angle="radian"/><worldbody>
    <body><freejoint/><geom size=".1"/><body><joint name="a" springref=".2"/><geom size=".1"/>
    <body><joint name="b" type="slide" springref=".3"/><geom size=".1"/></body></body></body></worldbody></mujoco>)";
  const LoadedModel loaded = LoadModel(file);
  std::filesystem::remove(file);
  const auto resolve = [&](const std::string& path) { return ResolvePath(*loaded.model, path).front(); };
  EXPECT_THAT(resolve("joint/b/springref").nominal, ElementsAre(0.3));
  EXPECT_THAT(resolve("joint/b/springref").indices, ElementsAre(8));
  EXPECT_EQ(resolve("joint/b/springref").unit, "m");
  EXPECT_THAT(resolve("joint/*/springref").nominal, ElementsAre(0.2, 0.3)) << "a free joint has no spring";
  EXPECT_THAT(resolve("joint/*/springref").places, ElementsAre("joint/a/springref", "joint/b/springref"));
  EXPECT_THAT([&] { ResolvePath(*loaded.model, "joint/#0/springref"); },
              ThrowsMessage<UsageError>(HasSubstr("no such joint slides or is a hinge")));
}

TEST(TiedPaths, AMassAndItsInertiaGrowAsAtAnotherDensity) {
  const LoadedModel light = Compiled("light", "<geom size=\".1\" density=\"500\"/>", "");
  const LoadedModel heavy = Compiled("heavy", "<geom size=\".1\" density=\"750\"/>", "");
  LoadedModel model = Compiled("light", "<geom size=\".1\" density=\"500\"/>", "");
  Write(*model.model, {.name = "link", .field = "body/link/mass + body/link/inertia"}, 1.5);
  EXPECT_DOUBLE_EQ(model.model->body_mass[1], heavy.model->body_mass[1]);
  for (int k = 3; k < 6; ++k) EXPECT_DOUBLE_EQ(model.model->body_inertia[k], heavy.model->body_inertia[k]);
  EXPECT_THAT([&] { ResolvePath(*light.model, "body/link/mass + body/*/mass"); },
              ThrowsMessage<UsageError>(HasSubstr("two of the paths name body/")));
  EXPECT_THAT([&] { ResolvePath(*light.model, "body/link/mass + body/lonk/inertia"); },
              ThrowsMessage<UsageError>(HasSubstr("body/lonk/inertia")));
}

TEST(BoundingRadius, IsTheCompilersForEveryShape) {
  const std::filesystem::path path = std::filesystem::path(testing::TempDir()) / "oted_shapes.xml";
  std::ofstream(path) << R"(<mujoco><worldbody>
    <geom type="plane" size="1 2 3"/><geom type="sphere" size=".3"/><geom type="capsule" size=".1 .4"/>
    <geom type="cylinder" size=".2 .5"/><geom type="ellipsoid" size=".1 .6 .2"/><geom type="box" size=".1 .2 .3"/>
    </worldbody></mujoco>)";
  const LoadedModel loaded = LoadModel(path);
  std::filesystem::remove(path);
  const mjModel& model = *loaded.model;
  ASSERT_EQ(model.ngeom, 6);
  for (int i = 0; i < 6; ++i) {
    EXPECT_DOUBLE_EQ(BoundingRadius(model.geom_type[i], model.geom_size + 3 * i, 0), model.geom_rbound[i]) << i;
  }
}

}  // namespace oted::model_field_test
