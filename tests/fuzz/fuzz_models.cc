#include "tests/fuzz/fuzz_models.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "oted/base/files.h"
#include "oted/base/seal.h"
#include "oted/data/npz.h"
#include "oted/nn/onnx_export.h"
#include "oted/nn/onnx_policy.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/run/records.h"
#include "oted/run/run_inputs.h"
#include "oted/sim/sysid_file.h"

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

/// A model that a task is made of.
FuzzFormat ModelFormat(const std::string& file, const std::string& seed, std::vector<std::string> motors) {
  FuzzFormat format;
  format.name = format.file = file;
  format.names = {file};
  format.seeds = {seed};
  format.is_text = true;
  format.read = [file, motors = std::move(motors)](const fs::path& folder) {
    TaskConfig task;
    task.model.model = (folder / file).string();
    task.model.control_period = 0.02;
    task.model.motors = motors;
    task.Resolve();
    MakeSimulatorFactory(task, {})->Make(1, 1);
  };
  return format;
}

/// A record as its codec reads it, behind the seal.
template <class Record>
FuzzFormat RecordFormat(const std::string& file, const Record& record) {
  FuzzFormat format;
  format.name = "record: " + file;
  format.file = file;
  format.names = {file};
  format.seeds = {record.ToJson().dump(2)};
  format.is_text = true;
  format.read = [file](const fs::path& folder) {
    Record::FromJson(ReadSealed(folder / file, true), (folder / file).string());
  };
  return format;
}

FuzzFormat OnnxFormat(const fs::path& folder) {
  FuzzFormat format;
  format.name = format.file = "policy.onnx";
  format.names = {format.file};
  const TanhGaussianPolicy policy(Normalizer{{0, 0, 0}, {1, 1, 1}}, {4}, {-1, -1}, {1, 1});
  WriteOnnx(policy, {}, folder / format.file);
  format.seeds = {ReadFile(folder / format.file)};
  format.read = [](const fs::path& f) { OnnxPolicy::Load(f / "policy.onnx"); };
  return format;
}

FuzzFormat SysidFormat() {
  FuzzFormat format;
  format.name = format.file = "parameters.yaml";
  format.names = {format.file};
  ParameterSpec friction;
  friction.name = "friction";
  friction.field = "geom/*/friction[0]";
  friction.low = 0.2;
  friction.high = 2;
  format.seeds = {SysidText({{.spec = friction}}, "a comment")};
  format.is_text = true;
  format.read = [](const fs::path& f) { ReadSysidFile(f / "parameters.yaml"); };
  return format;
}

FuzzFormat CheckpointFormat() {
  FuzzFormat format;
  format.name = format.file = "checkpoint.npz";
  format.names = {format.file};
  format.seeds = {
      NpzBytes({{"weights", NpyArray(std::vector<double>{1, 2, 3})}, {"step", NpyArray(std::vector<int64_t>{7})}})};
  format.read = [](const fs::path& f) { ReadCheckpoint(f / "checkpoint.npz"); };
  return format;
}

}  // namespace

void AddModelFormats(const fs::path& folder, std::vector<FuzzFormat>& formats) {
  formats.push_back(OnnxFormat(folder));
  formats.push_back(SysidFormat());
  formats.push_back(CheckpointFormat());
  formats.push_back(ModelFormat("model.xml", kMjcf, {}));
  formats.push_back(ModelFormat("robot.urdf", kUrdf, {"joint/*"}));

  WriteFileAtomically(folder / "task-model.xml", kMjcf);
  FuzzFormat task;
  task.name = task.file = "task.toml";
  task.names = {task.file, "task-model.xml", "task."};
  task.seeds = {kTask};
  task.is_text = true;
  task.read = [](const fs::path& f) {
    TaskConfig config = TaskConfig::FromArgument((f / "task.toml").string());
    config.Resolve();
    MakeSimulatorFactory(config, {})->Make(1, 1);
  };
  formats.push_back(task);

  formats.push_back(RecordFormat("clone.json", CloneRecord{}));
  formats.push_back(RecordFormat("agent.json", AgentRecord{.episodes = {{"length", 3.5}}}));
  PolicySelectionRecord selection;
  selection.simulators = {{1, {0.5, 1.5}}};
  selection.agents = {{1, {3, 4}, 3.5, 0}};
  formats.push_back(RecordFormat("policy_selection.json", selection));
  EvaluationRecord evaluation{
      "Hopper-v5", 2, {{"friction", "-", 1, 0.6, 0.7, 0.1, 0.1}}, {{"random", "random actions", 1, 2, 0, 3.0}}};
  formats.push_back(RecordFormat("evaluation.json", evaluation));
}

}  // namespace oted
