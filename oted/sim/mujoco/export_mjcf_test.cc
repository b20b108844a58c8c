#include "oted/sim/mujoco/export_mjcf.h"

#include <gmock/gmock.h>
#include <mujoco/mujoco.h>

#include <nlohmann/json.hpp>

#include "oted/base/error.h"
#include "oted/base/testing.h"
#include "oted/sim/channel_factory.h"
#include "oted/sim/mujoco/model.h"
#include "oted/sim/mujoco/model_compare.h"
#include "oted/sim/mujoco/model_field.h"
#include "oted/sim/mujoco/task.h"

namespace oted::export_mjcf_test {

using testing::HasSubstr;

// A model in which nothing stands where it is easily found: values from defaults and classes, masses from densities and
// a mesh, angles in degrees, an included file, assets in a folder of their own, servos, a tendon, a weld, a contact
// pair.
constexpr const char* kCrooked = R"(<mujoco model="crooked">
  <compiler angle="degree" meshdir="parts" texturedir="parts" inertiafromgeom="true" settotalmass="7" boundmass="0.01"/>
  <option timestep="0.004" integrator="implicitfast" gravity="0 0 -9.7"/>
  <include file="defaults.xml"/>
  <asset>
    <mesh name="wedge" file="wedge.obj" scale="0.9 1 1.1"/>
    <texture name="paint" type="2d" file="paint.png"/>
    <material name="paint" texture="paint"/>
  </asset>
  <worldbody>
    <geom name="ground" type="plane" size="5 5 0.1" material="paint"/>
    <body name="base" pos="0 0 0.6" euler="0 10 0">
      <joint name="x" type="slide" axis="1 0 0" damping="0" stiffness="0"/>
      <joint name="z" type="slide" axis="0 0 1" damping="0" stiffness="0"/>
      <joint name="pitch" axis="0 1 0" damping="0" stiffness="0"/>
      <geom name="hull" type="mesh" mesh="wedge" density="700"/>
      <site name="hip" pos="0 0 -0.1"/>
      <body name="arm" pos="0.1 0 -0.1" childclass="limb">
        <joint name="shoulder" range="-80 70"/>
        <geom name="upper" fromto="0 0 0 0.05 0 -0.3"/>
        <body name="hand" pos="0.05 0 -0.3">
          <joint name="elbow" range="-100 20" damping="0.7"/>
          <geom name="lower" fromto="0 0 0 0.1 0 -0.2" mass="0.4"/>
          <geom name="tip" type="sphere" size="0.06" pos="0.1 0 -0.2" friction="0.8"/>
          <site name="grip" pos="0.1 0 -0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <contact><pair geom1="tip" geom2="ground" friction="1.1 1.1 0.01 0.001 0.001"/></contact>
  <tendon><spatial name="cord" stiffness="3" damping="0.2"><site site="hip"/><site site="grip"/></spatial></tendon>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="20" ctrllimited="true" ctrlrange="-1 1"/>
    <motor name="elbow" joint="elbow" gear="3" ctrllimited="true" ctrlrange="-1 1"/>
  </actuator>
  <sensor><jointpos joint="elbow"/></sensor>
</mujoco>)";
constexpr const char* kDefaults = R"(<mujoco><default>
  <joint damping="0.3" armature="0.01" axis="0 1 0" stiffness="1"/>
  <geom friction="0.6 0.01 0.001" density="900"/>
  <default class="limb">
    <joint frictionloss="0.05" damping="0.5" limited="true"/>
    <geom type="capsule" size="0.04"/>
  </default>
</default></mujoco>)";
constexpr const char* kWedge =
    "v -0.2 -0.1 -0.1\nv 0.2 -0.1 -0.1\nv 0 0.1 -0.1\nv 0.05 0 0.15\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

// Python loads the exported file, compares it with the lane's model saved as MJB, and rolls it out beside the lane.
constexpr const char* kCompare = R"(
import json, mujoco, numpy as np
case = json.load(open("case.json"))
got, want = mujoco.MjModel.from_xml_path("designed.xml"), mujoco.MjModel.from_binary_path("lane.mjb")
compared = 0
for name in dir(want):
    value = None if name.startswith("_") else getattr(want, name)
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        np.testing.assert_allclose(getattr(got, name), value, rtol=1e-9, atol=1e-12, err_msg=name)
        compared += 1
assert compared > 100, compared
for name in ("gravity", "timestep", "density", "viscosity", "wind"):
    np.testing.assert_allclose(getattr(got.opt, name), getattr(want.opt, name), rtol=1e-9, err_msg=name)
for name, values in case["expanded"].items():
    field = got.opt.gravity if name == "opt.gravity" else getattr(got, name)
    np.testing.assert_allclose(np.ravel(field), values, rtol=1e-9, atol=1e-12, err_msg=name)
assert not got.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET, "the simulator's own switch"
data = mujoco.MjData(got)
mujoco.mj_setState(got, data, np.array(case["start"]), mujoco.mjtState.mjSTATE_INTEGRATION)
for step, (action, qpos, qvel) in enumerate(zip(case["actions"], case["qpos"], case["qvel"])):
    data.ctrl[:] = action
    for _ in range(case["frame_skip"]):
        mujoco.mj_step(got, data)
    np.testing.assert_allclose(data.qpos, qpos, rtol=0, atol=1e-9, err_msg=str(step))
    np.testing.assert_allclose(data.qvel, qvel, rtol=0, atol=1e-9, err_msg=str(step))
)";

struct ExportCase {
  std::string name, task;
  std::vector<ParameterSpec> specs;
  std::vector<double> z;
  bool crooked = false;
};

class ExportMjcf : public testing::TestWithParam<ExportCase> {
 protected:
  ~ExportMjcf() override { unsetenv("OTED_ASSETS"); }
  // The crooked model takes the place of Hopper's.
  void WriteCrooked() {
    WriteFileAtomically(folder_ / "models/hopper.xml", kCrooked);
    WriteFileAtomically(folder_ / "models/defaults.xml", kDefaults);
    WriteFileAtomically(folder_ / "models/parts/wedge.obj", kWedge);
    ASSERT_TRUE(
        RunPython("import imageio, numpy\nimageio.imwrite('models/parts/paint.png', numpy.full((2, 2, 3), 90, "
                  "dtype='uint8'))",
                  folder_));
    setenv("OTED_ASSETS", (folder_ / "models").c_str(), 1);
  }
  TestFolder folder_;
};

TEST_P(ExportMjcf, PythonLoadsTheLanesModelAndRollsItOutAlike) {
  const ExportCase& c = GetParam();
  if (c.crooked) WriteCrooked();
  const MujocoSimulatorFactory factory(c.task, c.specs);
  const auto simulator = factory.MakeMujoco(1, 1);
  simulator->SetParameters(0, c.z);
  Rng rng = RngKey(5).MakeRng();
  simulator->Reset(0, rng);
  const std::span<const double> state = simulator->IntegrationState(0);
  nlohmann::json record = {{"frame_skip", factory.frame_skip()},
                           {"start", std::vector<double>(state.begin(), state.end())},
                           {"expanded", nlohmann::json::object()}};
  ModelPtr lane(mj_copyModel(nullptr, &factory.model()));
  simulator->CopyModel(0, *lane);
  mj_saveModel(lane.get(), (folder_ / "lane.mjb").c_str(), nullptr, 0);
  const int first = 0;
  for (int step = 0; step < 200; ++step) {
    std::vector<double> action(static_cast<size_t>(factory.spec().act_dim));
    for (double& a : action) a = rng.Uniform(-1, 1);
    simulator->Step({&first, 1}, action);
    record["actions"].push_back(action);
    record["qpos"].push_back(std::vector<double>(simulator->qpos(0).begin(), simulator->qpos(0).end()));
    record["qvel"].push_back(std::vector<double>(simulator->qvel(0).begin(), simulator->qvel(0).end()));
  }
  // What the parameters are for, by hand: nominal times z, or z.
  for (size_t i = 0; i < c.specs.size(); ++i) {
    const ModelField field = ResolvePath(factory.model(), c.specs[i].field).front();
    if (field.array != "opt.gravity" && field.array != "geom_friction") continue;
    const double* pristine = field.array == "opt.gravity" ? factory.model().opt.gravity : factory.model().geom_friction;
    std::vector<double> values(pristine, pristine + (field.array == "opt.gravity" ? 3 : 3 * factory.model().ngeom));
    for (size_t k = 0; k < field.indices.size(); ++k) {
      values[static_cast<size_t>(field.indices[k])] =
          c.specs[i].scale == ParameterScale::kAbsolute ? c.z[i] : field.nominal[k] * c.z[i];
    }
    record["expanded"][field.array] = values;
  }
  WriteJson(folder_ / "case.json", record);
  WriteFileAtomically(folder_ / "designed.xml", DesignedMjcf(factory, c.z, "friction 0.5 +- 0.1 --> \xC3\xA9"));
  EXPECT_TRUE(RunPython(kCompare, folder_));
}

INSTANTIATE_TEST_SUITE_P(
    Every, ExportMjcf,
    testing::Values(
        ExportCase{"Hopper",
                   "Hopper-v5",
                   {{.name = "friction", .field = "geom/*/friction[0]"},
                    {.name = "gain", .field = "actuator/*/gainprm[0]"},
                    {.name = "gravity", .field = "opt/gravity[2]"}},
                   {0.5491234567891, 0.6887654321, 1.3501}},
        ExportCase{"CheetahMasses",
                   "HalfCheetah-v5",
                   {{.name = "mass", .field = "body/*/mass"},
                    {.name = "inertia", .field = "body/*/inertia"},
                    {.name = "armature", .field = "joint/b*/armature"},
                    {.name = "damping", .field = "joint/*/damping"},
                    {.name = "gear", .field = "actuator/*/gear[0]"},
                    {.name = "stiffness", .field = "joint/*/stiffness"},
                    {.name = "rest",
                     .field = "joint/fthigh/springref",
                     .low = -1,
                     .high = 1,
                     .scale = ParameterScale::kAbsolute}},
                   {1.2345, 0.87654321, 1.31, 0.7, 0.9, 1.1, 0.3}},
        ExportCase{
            "WalkerShapes",
            "Walker2d-v5",
            {{.name = "size", .field = "geom/*_geom/size[0]", .low = 0.8, .high = 1.2},
             {.name = "loss", .field = "joint/*/frictionloss", .low = 0, .high = 1, .scale = ParameterScale::kAbsolute},
             {.name = "range", .field = "joint/thigh_joint/range"},
             {.name = "com",
              .field = "body/torso/ipos[0]",
              .low = -0.1,
              .high = 0.1,
              .scale = ParameterScale::kAbsolute},
             {.name = "solref", .field = "geom/*/solref[0]"}},
            {1.0712345, 0.0312345, 0.812345, 0.0123456789, 1.3}},
        ExportCase{"CrookedFriction", "Hopper-v4", {{.name = "friction", .field = "geom/*/friction[0]"}}, {0.7}, true},
        ExportCase{"CrookedEverything",
                   "Hopper-v4",
                   {{.name = "friction", .field = "geom/*/friction[0]"},
                    {.name = "pair", .field = "pair/*/friction[0]"},
                    {.name = "gain", .field = "actuator/shoulder/gainprm[0]"},
                    {.name = "bias", .field = "actuator/shoulder/biasprm[1]"},
                    {.name = "gear", .field = "actuator/elbow/gear[0]"},
                    {.name = "cord", .field = "tendon/cord/stiffness"},
                    {.name = "mass", .field = "body/hand/mass"},
                    {.name = "armature", .field = "joint/*/armature"},
                    {.name = "damping", .field = "joint/elbow/damping"},
                    {.name = "loss", .field = "joint/*/frictionloss"},
                    {.name = "place", .field = "body/hand/pos[2]", .low = 0.8, .high = 1.2},
                    {.name = "grip", .field = "site/grip/pos[0]"},
                    {.name = "wind", .field = "opt/wind[0]", .low = 0, .high = 3, .scale = ParameterScale::kAbsolute},
                    {.name = "air", .field = "opt/density", .low = 0, .high = 3, .scale = ParameterScale::kAbsolute},
                    {.name = "gravity", .field = "opt/gravity[2]"}},
                   {0.7, 1.3, 1.4, 1.2, 0.6, 1.5, 0.8, 1.7, 0.9, 1.1, 1.05, 0.9, 1.25, 1.2, 0.95},
                   true}),
    [](const auto& parameter) { return parameter.param.name; });

TEST(DesignedMjcf, AtTheNominalValuesIsTheModelItCameFrom) {
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "mass", .field = "body/*/mass"}});
  TestFolder folder;
  WriteFileAtomically(folder / "same.xml", DesignedMjcf(factory, std::vector{1.0}, "nominal"));
  const std::string text = ReadFile(folder / "same.xml");
  EXPECT_EQ(FirstDifference(*LoadModel(folder / "same.xml").model, factory.model()), "");
  EXPECT_THAT(text, Not(HasSubstr("<inertial"))) << "masses stay inferred where nothing changes them";
  EXPECT_THAT(text, HasSubstr("friction=\"0.9\"")) << "not 0.90000000000000002";
}

TEST(DesignedMjcf, ActuatorsActLaterByTheDelayAndByNothingElse) {
  const MujocoSimulatorFactory factory("HalfCheetah-v5", {{.name = "friction", .field = "geom/*/friction[0]"}});
  const std::vector<double> z = {0.7};
  const double step = factory.model().opt.timestep;
  const auto forces = [&](double delay, const std::vector<double>& commands) {
    const std::vector<double> delays = {delay, 0, 0, 3 * step, 0, 0};
    const std::string text = DesignedMjcf(factory, z, "", delays);
    const SpecPtr spec(mj_parseXMLString(text.c_str(), nullptr, nullptr, 0));
    const ModelPtr model(mj_compile(spec.get(), nullptr));
    std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
    std::vector<double> got;
    for (const double command : commands) {
      data->ctrl[0] = data->ctrl[1] = command;
      mj_step(model.get(), data.get());
      got.push_back(data->actuator_force[0]);
      EXPECT_EQ(data->actuator_force[1], command) << "another actuator";
    }
    return got;
  };
  const std::vector<double> commands = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  EXPECT_EQ(forces(0, commands), commands);
  EXPECT_EQ(forces(0.4 * step, commands), commands) << "MuJoCo has nothing between none and one step";
  EXPECT_EQ(forces(0.6 * step, commands), (std::vector<double>{0, 0.1, 0.2, 0.3, 0.4, 0.5}));
  const std::vector<double> two = forces(2 * step, commands), half = forces(1.5 * step, commands);
  for (size_t k = 0; k < commands.size(); ++k) {
    EXPECT_NEAR(two[k], k < 2 ? 0.0 : commands[k - 2], 1e-12) << k;
    const double last = k < 1 ? 0 : commands[k - 1], before = k < 2 ? 0 : commands[k - 2];
    EXPECT_NEAR(half[k], (last + before) / 2, 1e-12) << k;
  }
}

TEST(DesignedMjcf, WithADelayMovesAsTheDesignsOwnSimulatorDoes) {
  std::vector<ParameterSpec> specs = {
      {.name = "friction", .field = "geom/*/friction[0]"},
      {.name = "delay", .field = "action/delay", .low = 0, .high = 3, .scale = ParameterScale::kAbsolute}};
  const MujocoSimulatorFactory plant("HalfCheetah-v5", {specs.front()});
  const int n_steps = plant.frame_skip();
  const double delay = 1.3, of_step = plant.model().opt.timestep;  // 6.5 time steps
  const auto simulator = WithChannels(specs, [](std::vector<ParameterSpec> own) {
                           return std::make_unique<MujocoSimulatorFactory>("HalfCheetah-v5", std::move(own));
                         })->Make(1, 1);
  simulator->SetParameters(0, std::vector<double>{0.7, delay});
  const std::string text =
      DesignedMjcf(plant, std::vector<double>{0.7}, "", std::vector<double>(6, delay * n_steps * of_step));
  const SpecPtr spec(mj_parseXMLString(text.c_str(), nullptr, nullptr, 0));
  const ModelPtr model(mj_compile(spec.get(), nullptr));
  std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
  const std::vector<double> qpos(static_cast<size_t>(model->nq), 0.01), qvel(static_cast<size_t>(model->nv), 0.1);
  Rng rng(1);
  simulator->ResetTo(0, qpos, qvel, rng);
  std::ranges::copy(qpos, data->qpos);
  std::ranges::copy(qvel, data->qvel);
  const int lane = 0;
  for (int k = 0; k < 12; ++k) {
    std::vector<double> action(6);
    for (size_t i = 0; i < 6; ++i) action[i] = std::sin(2.7 * k + static_cast<double>(i));
    simulator->Step({&lane, 1}, action);
    std::ranges::copy(action, data->ctrl);
    for (int step = 0; step < n_steps; ++step) mj_step(model.get(), data.get());
    for (int i = 0; i < model->nq; ++i)
      EXPECT_NEAR(simulator->pose(0)[static_cast<size_t>(i)], data->qpos[i], 1e-9) << k;
  }
}

// MuJoCo 4 refuses to move the centre of mass of a body that it compiled as a simple one.
TEST(DesignedMjcf, ALoadBesideTheCentreOfABoxActsAsInAModelThatHasIt) {
  const TestFolder folder;
  const auto write = [&](const std::string& name, const std::string& inertial) {
    WriteFileAtomically(folder / name,
                        R"(<mujoco><worldbody><body name="hull" pos="0 0 1"><freejoint/>)" + inertial +
                            R"(<geom type="box" size="0.3 0.2 0.1"/><site name="side"/></body></worldbody>
      <actuator><motor site="side" gear="1" ctrlrange="-1 1"/></actuator></mujoco>)");
    return LoadModel(folder / name);
  };
  const auto inertial = [](const std::string& x) {
    return R"(<inertial pos=")" + x + R"( 0 0" mass="2" diaginertia="0.1 0.2 0.25"/>)";
  };
  const LoadedModel truth = write("truth.xml", inertial("0.05"));
  write("model.xml", inertial("0"));
  ModelTask task;
  task.name = "box";
  task.model = folder / "model.xml";
  task.observations = {"joint/*/qpos", "joint/*/qvel"};
  task.control_period = 0.02;
  const ParameterSpec load{
      .name = "load", .field = "body/hull/ipos[0]", .low = -0.2, .high = 0.2, .scale = ParameterScale::kAbsolute};
  const MujocoSimulatorFactory factory(task, {load});
  const std::string text = DesignedMjcf(factory, std::vector{0.05}, "");
  EXPECT_THAT(text, Not(HasSubstr("simple="))) << "older versions do not know it";
  WriteFileAtomically(folder / "designed.xml", text);
  const LoadedModel designed = LoadModel(folder / "designed.xml");
  const auto fall = [](const mjModel& model) {
    std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(&model), mj_deleteData);
    data->qvel[4] = 3;
    for (int k = 0; k < 200; ++k) mj_step(&model, data.get());
    return std::vector<double>(data->qpos, data->qpos + model.nq);
  };
  const std::vector<double> expected = fall(*truth.model), got = fall(*designed.model);
  const auto simulator = factory.MakeMujoco(1, 1);
  simulator->SetParameters(0, std::vector<double>{0.05});
  ModelPtr in_batch(mj_copyModel(nullptr, &factory.model()));
  simulator->CopyModel(0, *in_batch);
  const std::vector<double> of_batch = fall(*in_batch);
  for (size_t i = 0; i < expected.size(); ++i) {
    EXPECT_NEAR(got[i], expected[i], 1e-12) << i;
    EXPECT_NEAR(of_batch[i], expected[i], 1e-12) << i;
  }
  EXPECT_GT(std::abs(expected[0]), 0.01) << "without the load it turns about its frame";
}

TEST(DesignedMjcf, AnOrientationOrAxisOfWhichOneNumberIsSetKeepsLengthOne) {
  const auto parameter = [](const char* name, const char* field) {
    return ParameterSpec{.name = name, .field = field, .low = -1, .high = 1, .scale = ParameterScale::kAbsolute};
  };
  const MujocoSimulatorFactory factory(
      "Hopper-v5", {parameter("turned", "body/foot/iquat[1]"), parameter("axis", "joint/foot_joint/axis[0]")});
  const auto of_z = [&](const std::vector<double>& z) {
    const auto simulator = factory.MakeMujoco(1, 1);
    simulator->SetParameters(0, std::vector<double>{0.5, 0.3});
    simulator->SetParameters(0, z);
    ModelPtr model(mj_copyModel(nullptr, &factory.model()));
    simulator->CopyModel(0, *model);
    return model;
  };
  const mjModel& pristine = factory.model();
  const int foot = mj_name2id(&pristine, mjOBJ_BODY, "foot"), joint = mj_name2id(&pristine, mjOBJ_JOINT, "foot_joint");
  const ModelPtr moved = of_z({0.5, 0.3});
  EXPECT_NEAR(mju_norm(moved->body_iquat + 4 * foot, 4), 1, 1e-12);
  EXPECT_NEAR(mju_norm3(moved->jnt_axis + 3 * joint), 1, 1e-12);
  EXPECT_NEAR(moved->jnt_axis[3 * joint] / moved->jnt_axis[3 * joint + 1], 0.3 / pristine.jnt_axis[3 * joint + 1],
              1e-12);
  const ModelPtr back = of_z(factory.parameters().Nominal());
  EXPECT_EQ(FirstDifference(*back, pristine), "") << "what was scaled beside the parameter's number comes back";
  EXPECT_NO_THROW(DesignedMjcf(factory, std::vector{0.5, 0.3}, ""));
}

TEST(DesignedMjcf, RefusesAValueOutsideItsBounds) {
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "mass", .field = "body/*/mass"}});
  EXPECT_THROW(DesignedMjcf(factory, std::vector{7.0}, ""), UsageError);
}

// The compiler refuses it: A + B >= C must hold for a body's inertia.
TEST(DesignedMjcf, AModelThatMujocoCannotCompileAgainIsADataErrorWithItsReason) {
  const MujocoSimulatorFactory factory("Hopper-v5", {{.name = "i", .field = "body/foot/inertia[0]", .high = 9}});
  const std::string message = MessageOf<DataError>([&] { DesignedMjcf(factory, std::vector{8.0}, ""); });
  EXPECT_THAT(message, testing::AllOf(HasSubstr("hopper.xml"), HasSubstr("inertia"), HasSubstr("--sysid")));
}

TEST(FirstDifference, NamesTheNumberThatDiffers) {
  const LoadedModel one = LoadModel(AssetFolder() / "hopper.xml");
  ModelPtr other(mj_copyModel(nullptr, one.model.get()));
  EXPECT_EQ(FirstDifference(*one.model, *other), "");
  other->geom_friction[3] *= 1 + 1e-10;
  EXPECT_EQ(FirstDifference(*one.model, *other), "") << "within the tolerance";
  other->geom_friction[3] *= 1 + 1e-8;
  EXPECT_THAT(FirstDifference(*one.model, *other), HasSubstr("geom_friction[3]"));
  other.reset(mj_copyModel(nullptr, one.model.get()));
  other->opt.gravity[2] = -9;
  EXPECT_EQ(FirstDifference(*one.model, *other), "opt.gravity[2] is -9.81, not -9");
}

}  // namespace oted::export_mjcf_test
