#include "oted/sim/mujoco/model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/sim/mujoco/legacy_inertia.h"
#include "oted/sim/mujoco/mesh_files.h"
#include "oted/sim/mujoco/model_hash.h"
#include "oted/sim/mujoco/mujoco_errors.h"
#include "oted/sim/mujoco/object_path.h"

namespace oted {
namespace {

constexpr int kMostIterations = 100'000;
constexpr mjtSize kMostModel = mjtSize{1} << 27;  // [bytes], compiled: of it a program holds several
constexpr mjtSize kMostArena = mjtSize{1} << 30;  // [bytes], of each simulation

[[noreturn]] void FailToLoad(const std::filesystem::path& path, const std::string& reason) {
  throw DataError(fmt::format("MuJoCo {} cannot load '{}': {}", mj_versionString(), path.string(), reason));
}

SpecPtr Parse(const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path)) {
    throw DataError(fmt::format("no model file at '{}'; set OTED_ASSETS to the folder that holds it", path.string()));
  }
  std::array<char, 1000> reason{};
  const MujocoWarnings warnings;
  SpecPtr spec(mj_parseXML(path.c_str(), nullptr, reason.data(), static_cast<int>(reason.size())));
  if (spec == nullptr) FailToLoad(path, reason.data());
  for (const std::string& warning : warnings.told()) {
    // MuJoCo takes its default in place of a number that is none.
    if (warning.find("NaN") != std::string::npos) FailToLoad(path, warning);
  }
  FindMeshFiles(*spec, path);
  return spec;
}

/// What MuJoCo compiles and then never ends, or ends in numbers that are none.
void CheckOptions(const mjModel& model, const std::filesystem::path& path) {
  const mjOption& option = model.opt;
  const auto fail = [&](const std::string& what) {
    throw DataError(fmt::format("model '{}': {}; correct the model", path.string(), what));
  };
  if (!(option.timestep > 0) || !std::isfinite(option.timestep)) {
    fail(fmt::format("its time step is {} s, wanted a positive number", option.timestep));
  }
  for (const auto& [name, value] :
       {std::pair{"gravity", option.gravity}, {"wind", option.wind}, {"magnetic", option.magnetic}}) {
    if (!std::all_of(value, value + 3, [](double v) { return std::isfinite(v); })) {
      fail(fmt::format("its option {} is not finite", name));
    }
  }
  for (const auto& [name, value] : {std::pair{"density", option.density},
                                    {"viscosity", option.viscosity},
                                    {"impratio", option.impratio},
                                    {"tolerance", option.tolerance}}) {
    if (!std::isfinite(value)) fail(fmt::format("its option {} is not finite", name));
  }
  for (const auto& [name, n] : {std::pair{"iterations", option.iterations},
                                {"ls_iterations", option.ls_iterations},
                                {"noslip_iterations", option.noslip_iterations}}) {
    if (n < 0 || n > kMostIterations) {
      fail(fmt::format("its option {} is {}, wanted 0 to {}", name, n, kMostIterations));
    }
  }
  if (model.nbuffer > kMostModel) {
    fail(fmt::format(
        "compiled, it takes {} MiB, wanted at most {}; make its textures, height fields and meshes smaller, "
        "or take out what is only looked at",
        model.nbuffer >> 20, kMostModel >> 20));
  }
  if (model.narena > kMostArena) {
    fail(fmt::format("it asks for {} MiB of memory in each simulation, wanted at most {}", model.narena >> 20,
                     kMostArena >> 20));
  }
}

ModelPtr Compile(mjSpec& spec, const std::filesystem::path& path) {
  ModelPtr model(mj_compile(&spec, nullptr));
  if (model == nullptr) FailToLoad(path, mjs_getError(&spec));
  CheckOptions(*model, path);
  return model;
}

LoadedModel Finish(SpecPtr spec, ModelPtr model) {
  LoadedModel loaded;
  loaded.spec = std::move(spec);
  loaded.model = std::move(model);
  loaded.disable_flags = loaded.model->opt.disableflags;
  loaded.sha256 = ModelSha256(*loaded.model);
  loaded.model->opt.disableflags |= mjDSBL_AUTORESET;
  return loaded;
}

// The control range of a motor on a joint.
std::array<double, 2> MotorRange(const mjModel& model, int joint, const std::vector<double>& range) {
  const std::string name = ObjectName(model, mjOBJ_JOINT, joint);
  if (model.jnt_type[joint] != mjJNT_HINGE && model.jnt_type[joint] != mjJNT_SLIDE) {
    throw UsageError(fmt::format("task.motors: joint '{}' is neither hinge nor slide; name the joints that are", name));
  }
  if (name.starts_with('#')) {
    throw UsageError(fmt::format("task.motors: joint '{}' has no name; give it one in the model", name));
  }
  if (model.jnt_actfrclimited[joint]) return {model.jnt_actfrcrange[2 * joint], model.jnt_actfrcrange[2 * joint + 1]};
  if (range.size() == 2) return {range[0], range[1]};
  throw UsageError(
      fmt::format("task.motors: joint '{}' has no force limit (actuatorfrcrange, in URDF effort); set "
                  "task.action_range = [low, high]",
                  name));
}

}  // namespace

std::string SerializeModel(const mjModel& model) {
  std::string bytes(static_cast<size_t>(mj_sizeModel(&model)), '\0');
  mj_saveModel(&model, nullptr, bytes.data(), static_cast<mjtSize>(bytes.size()));
  return bytes;
}

LoadedModel LoadModel(const std::filesystem::path& path, bool legacy_capsules) {
  TakeOverMujocoErrors();
  SpecPtr spec = Parse(path);
  ModelPtr model = Compile(*spec, path);
  if (legacy_capsules) {
    UseLegacyCapsules(*spec, *model, path.string());
    model = Compile(*spec, path);
  }
  return Finish(std::move(spec), std::move(model));
}

LoadedModel LoadModelWithMotors(const std::filesystem::path& path, const std::vector<std::string>& motors,
                                const std::vector<double>& range) {
  if (motors.empty()) return LoadModel(path);
  TakeOverMujocoErrors();
  SpecPtr spec = Parse(path);
  const ModelPtr plain = Compile(*spec, path);
  std::set<int> joints;  // in the model's order, each once
  for (const std::string& motor : motors) {
    const std::string what = fmt::format("task.motors '{}' (model '{}')", motor, path.string());
    if (!motor.starts_with("joint/")) throw UsageError(what + ": wanted joint/NAME, with * for any text");
    const ObjectKind kind{"joint", mjOBJ_JOINT, static_cast<int>(plain->njnt)};
    for (const int id : MatchObjects(*plain, kind, std::string_view(motor).substr(6), what)) joints.insert(id);
  }
  for (const int joint : joints) {
    const std::array<double, 2> limits = MotorRange(*plain, joint, range);
    const std::string name = ObjectName(*plain, mjOBJ_JOINT, joint);
    mjsActuator* actuator = mjs_addActuator(spec.get(), nullptr);
    mjs_setToMotor(actuator);
    mjs_setName(actuator->element, name.c_str());
    mjs_setString(actuator->target, name.c_str());
    actuator->trntype = mjTRN_JOINT;
    actuator->ctrllimited = mjLIMITED_TRUE;
    std::copy(limits.begin(), limits.end(), actuator->ctrlrange);
  }
  ModelPtr model = Compile(*spec, path);
  return Finish(std::move(spec), std::move(model));
}

void AllowSimple(mjSpec& spec, const std::set<int>& bodies, bool allow) {
  for (mjsElement* e = mjs_firstElement(&spec, mjOBJ_BODY); e != nullptr; e = mjs_nextElement(&spec, e)) {
    if (bodies.contains(mjs_getId(e))) mjs_asBody(e)->simple = allow ? 1 : 0;
  }
}

void LetInertiaMove(LoadedModel& loaded, const std::set<int>& bodies) {
  AllowSimple(*loaded.spec, bodies, false);
  ModelPtr model(mj_compile(loaded.spec.get(), nullptr));
  if (model == nullptr) {
    throw DataError(fmt::format("MuJoCo cannot compile the model again: {}", mjs_getError(loaded.spec.get())));
  }
  AllowSimple(*loaded.spec, bodies, true);
  model->opt.disableflags = loaded.model->opt.disableflags;
  loaded.model = std::move(model);
}

}  // namespace oted
