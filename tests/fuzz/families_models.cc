// What a simulator and its policies are made of: MJCF, URDF, task and run files (TOML), parameter files (YAML), ONNX.

#include "oted/base/files.h"
#include "oted/nn/onnx_export.h"
#include "oted/nn/onnx_policy.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/run/run_inputs.h"
#include "oted/sim/sysid_file.h"
#include "tests/fuzz/families.h"

namespace oted {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMjcf = R"(<mujoco model="m">
  <option timestep="0.01" gravity="0 0 -9.81"><flag contact="enable"/></option>
  <default><geom friction="1 0.1 0.1"/><default class="light"><geom density="100"/></default></default>
  <asset><hfield name="h" nrow="4" ncol="4" size="1 1 0.2 0.1"/><material name="red" rgba="1 0 0 1"/>
    <mesh name="tip" vertex="0 0 0 0.1 0 0 0 0.1 0 0 0 0.1"/></asset>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>
    <replicate count="3" offset="0.5 0 0"><geom type="box" size="0.1 0.1 0.1" material="red"/></replicate>
    <body name="arm" pos="0 0 1"><joint name="shoulder" axis="0 1 0" damping="0.1" range="-2 2" limited="true"/>
      <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.05" class="light"/>
      <body pos="0.5 0 0"><joint name="elbow" type="slide" axis="1 0 0"/><geom type="mesh" mesh="tip"/><site name="s"/></body>
    </body>
  </worldbody>
  <tendon><fixed name="t"><joint joint="elbow" coef="0.5"/></fixed></tendon>
  <equality><joint joint1="shoulder" joint2="elbow" polycoef="0 1 0 0 0" active="false"/></equality>
  <actuator><motor name="a" joint="shoulder" ctrlrange="-1 1"/></actuator>
  <sensor><gyro site="s"/></sensor>
  <keyframe><key qpos="0.1 0.2"/></keyframe>
</mujoco>
)";

constexpr const char* kUrdf = R"(<robot name="r">
  <link name="base"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><box size="0.2 0.1 0.1"/></geometry></collision></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="2" velocity="3"/><dynamics damping="0.1" friction="0.2"/></joint>
</robot>
)";

constexpr const char* kTask = R"toml([task]
model = "task-model.xml"
control_period = 0.02
observations = ["joint/*/qpos", "joint/*/qvel"]
max_episode_steps = 50
reward = "1 - abs(angle)"
terminate = "angle > 1.5"
[task.quantities]
angle = "joint/shoulder/qpos"
)toml";

/// As far as a design goes with a task before it needs logs: one control period of one lane.
void Simulate(TaskConfig task) {
  task.Resolve();
  const auto simulator = MakeSimulatorFactory(task, {})->Make(1, 1);
  Rng rng(1);
  simulator->Reset(0, rng);
  const std::vector<int> lanes = {0};
  simulator->Step(lanes, std::vector<double>(static_cast<size_t>(simulator->spec().act_dim), 0.5));
}

/// A model that a task is made of.
FuzzReader ModelReader(const std::string& file, std::vector<std::string> motors) {
  return {file,
          [file, motors = std::move(motors)](const fs::path& folder) {
            TaskConfig task;
            task.model.model = (folder / file).string();
            task.model.control_period = 0.02;
            task.model.motors = motors;
            Simulate(task);
          },
          {"task."}};
}

FuzzFamily TaskFamily(const fs::path& folder) {
  FuzzFamily family{.name = "task"};
  WriteFileAtomically(folder / "task-model.xml", kMjcf);
  RunConfig config;
  config.task.name = "Hopper-v5";
  config.data.path = "demos.hdf5";
  config.data.columns.observations = {"a", "b"};
  ParameterSpec friction;
  friction.name = "friction";
  friction.field = "geom/*/friction[0]";
  friction.low = 0.2;
  friction.high = 2;
  ParameterSpec gravity = friction;
  gravity.name = "gravity";
  gravity.field = "opt/gravity[2]";
  config.parameters = {friction, gravity};
  config.truth = {{"friction", 1.0}, {"gravity", 1.1}};
  config.settings["a"] = config.design;
  family.seeds = {kTask, config.ToToml(),
                  "[task]\nname = \"Hopper-v5\"\n[data]\npath = 'a.csv'\n[parameters]\ng = { field = "
                  "\"opt/gravity[2]\", range = [0.2, 2.0] }\n"};
  family.readers = {{"task.toml",
                     [](const fs::path& f) { Simulate(TaskConfig::FromArgument((f / "task.toml").string())); },
                     {"task-model.xml", "task.", "unknown task"}},
                    {"run.toml", [](const fs::path& f) { RunConfig::FromTomlFile((f / "run.toml").string()); }}};
  return family;
}

FuzzFamily SysidFamily() {
  ParameterSpec friction;
  friction.name = "friction";
  friction.field = "geom/*/friction[0]";
  friction.low = 0.2;
  friction.high = 2;
  return {.name = "sysid",
          .seeds = {SysidText({{.spec = friction}}, "a comment")},
          .readers = {{"parameters.yaml", [](const fs::path& f) { ReadSysidFile(f / "parameters.yaml"); }}}};
}

FuzzFamily OnnxFamily(const fs::path& folder) {
  const TanhGaussianPolicy policy(Normalizer{{0, 0, 0}, {1, 1, 1}}, {4}, {-1, -1}, {1, 1});
  WriteOnnx(policy, {}, folder / "policy.onnx");
  return {.name = "onnx",
          .seeds = {ReadFile(folder / "policy.onnx")},
          .readers = {{"policy.onnx", [](const fs::path& f) {
                         OnnxPolicy::Load(f / "policy.onnx").Evaluate(std::vector<double>{1, -2, 0.5, 0, 0, 3}, 2);
                       }}}};
}

}  // namespace

void AddModelFamilies(const fs::path& folder, std::vector<FuzzFamily>& families) {
  families.push_back(OnnxFamily(folder));
  families.push_back(SysidFamily());
  families.push_back({.name = "model",
                      .seeds = {kMjcf, kUrdf},
                      .readers = {ModelReader("model.xml", {}), ModelReader("robot.urdf", {"joint/*"})}});
  families.push_back(TaskFamily(folder));
}

}  // namespace oted
