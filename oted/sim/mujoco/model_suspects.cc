#include "oted/sim/mujoco/model_suspects.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "oted/base/error.h"
#include "oted/sim/mujoco/model_field.h"
#include "oted/sim/mujoco/model_scale.h"
#include "oted/sim/mujoco/object_path.h"
#include "oted/sim/suspect_name.h"

namespace oted {
namespace {

constexpr int kMostBodies = 12;  // whose masses, centres of mass and places are suspected one by one
constexpr int kMostSingly = 8;   // joints, drives or tendons that are, where others of them are searched
constexpr double kLow = 0.1, kHigh = 10.0;
constexpr double kMostLoadFriction = 0.9;  // of the force of a joint's actuators
constexpr double kMostTilt = 0.2;          // of gravity: some eleven degrees
constexpr double kFrictionShare = 0.1;     // of the torque that holds a mean body at the model's length against gravity

struct SuspectedField {
  std::string name, path;
  /// Where the model has zeros alone: paths, of which the first that it has is suspected as a value.
  std::vector<std::string> if_zero = {};
  double most = 0;  ///< of it; without such a path: `path` itself, from minus that to that
};

std::vector<std::string> OfJoints(const std::string& field) { return {"joint/@actuated/" + field, "joint/*/" + field}; }

std::vector<SuspectedField> SuspectedFields(const mjModel& model) {
  const double torque = RoundBound(kFrictionShare * HoldingTorque(model));
  const double tension = RoundBound(kFrictionShare * HoldingTension(model));
  std::vector<SuspectedField> places = {
      {"damping", "joint/*/damping", OfJoints("damping"), torque},
      {"armature", "joint/*/armature", OfJoints("armature"), RoundBound(model.stat.meaninertia)},
      {"frictionloss", "joint/*/frictionloss", OfJoints("frictionloss"), torque},
      {"load_friction", "joint/@actuated/load_friction", OfJoints("load_friction"), kMostLoadFriction},
      {"stribeck_torque", "joint/@actuated/stribeck_torque", OfJoints("stribeck_torque"), torque},
      {"stiffness", "joint/*/stiffness"},
      {"gear", "actuator/*/gear[0]"},
      {"kp", "actuator/*/kp"},
      {"kv", "actuator/*/kv"},
      {"friction", "geom/*/friction[0]"},
      {"contact_time", "geom/*/solref[0]"},
      {"contact_damping", "geom/*/solref[1]"},
      {"tendon_frictionloss", "tendon/*/frictionloss", {"tendon/*/frictionloss"}, tension},
      {"tendon_damping", "tendon/*/damping", {"tendon/*/damping"}, tension},
      {"tendon_stiffness", "tendon/*/stiffness"},
      {"viscosity", "opt/viscosity"},
      {"density", "opt/density"},
      {"inertia", "body/*/inertia"},
      {"gravity", "opt/gravity[2]"}};
  if (model.na > 0) places.push_back({"drive_lag", "actuator/*/dynprm[0]"});
  if (const double down = std::abs(model.opt.gravity[2]);
      down > 0 && model.opt.gravity[0] == 0 && model.opt.gravity[1] == 0) {
    // A base that does not stand level, and a floor that is none.
    places.push_back({"tilt_x", "opt/gravity[0]", {}, RoundBound(kMostTilt * down)});
    places.push_back({"tilt_y", "opt/gravity[1]", {}, RoundBound(kMostTilt * down)});
  }
  if (model.nbody - 1 > kMostBodies) {
    places.push_back({"mass", "body/*/mass"});
    return places;
  }
  for (int body = 1; body < model.nbody; ++body) {
    const std::string name = model.names + model.name_bodyadr[body];
    const std::string object = name.empty() ? fmt::format("#{}", body) : name;
    const std::string called = name.empty() ? fmt::format("body{}", body) : name;
    places.push_back({called + "_mass", fmt::format("body/{}/mass", object)});
    places.push_back({called + "_com", fmt::format("body/{}/ipos", object)});
    // The length of the link before it.
    if (model.body_parentid[body] > 0) places.push_back({called + "_pos", fmt::format("body/{}/pos", object)});
  }
  return places;
}

/// None where the model has none, or only zeros of a multiple.
std::optional<std::vector<ModelField>> Resolved(const mjModel& model, ParameterSpec& spec) {
  try {
    return ResolveParameter(model, spec);
  } catch (const UsageError&) {
    return std::nullopt;
  }
}

/// Completes `spec` at the first of the place's meanings that the model has.
std::optional<std::vector<ModelField>> FieldsOf(const mjModel& model, const SuspectedField& place,
                                                ParameterSpec& spec) {
  if (place.if_zero.empty() && place.most > 0) {
    spec = {.name = place.name,
            .field = place.path,
            .low = -place.most,
            .high = place.most,
            .scale = ParameterScale::kAbsolute};
    return Resolved(model, spec);
  }
  spec = {.name = place.name, .field = place.path, .low = kLow, .high = kHigh, .logarithmic = true};
  std::optional<std::vector<ModelField>> fields = Resolved(model, spec);
  if (fields || place.if_zero.empty()) return fields;
  for (const std::string& path : place.if_zero) {
    spec = {.name = place.name, .field = path, .low = 0, .high = place.most, .scale = ParameterScale::kAbsolute};
    fields = Resolved(model, spec);
    if (fields) return spec.nominal == 0 ? fields : std::nullopt;
  }
  return std::nullopt;
}

/// The same of each joint, drive or tendon alone, for those of which the rest is searched: "joint/elbow/damping".
std::vector<SuspectedField> OneByOne(const mjModel& model, const SuspectedField& place, const std::string& path) {
  const std::vector<ObjectKind> kinds = {{"joint", mjOBJ_JOINT, static_cast<int>(model.njnt)},
                                         {"actuator", mjOBJ_ACTUATOR, static_cast<int>(model.nactuator)},
                                         {"tendon", mjOBJ_TENDON, static_cast<int>(model.ntendon)}};
  const size_t first = path.find('/'), last = path.rfind('/');
  const auto kind = std::ranges::find(kinds, path.substr(0, first), &ObjectKind::word);
  if (kind == kinds.end()) return {};
  const std::vector<int> ids = MatchObjects(model, *kind, path.substr(first + 1, last - first - 1), path);
  if (ids.size() > static_cast<size_t>(kMostSingly)) return {};
  std::vector<SuspectedField> each;
  for (const int id : ids) {
    const std::string name = ObjectName(model, kind->type, id);
    const std::string own = path.substr(0, first + 1) + name + path.substr(last);
    const std::vector<std::string> if_zero(place.if_zero.empty() ? 0 : 1, own);
    each.push_back({name + "_" + place.name, own, if_zero, place.most});
  }
  return each;
}

}  // namespace

std::vector<ParameterSpec> ModelSuspects(const mjModel& model, const ParameterSpace& searched) {
  std::vector<ModelField> taken;
  for (const ParameterSpec& spec : searched.specs())
    std::ranges::move(ResolvePath(model, spec.field), std::back_inserter(taken));
  std::vector<ParameterSpec> suspects;
  const auto is_taken = [&](const ModelField& field) {
    return std::ranges::any_of(taken, [&](const ModelField& other) { return SharePlace(field, other); });
  };
  const auto add = [&](const SuspectedField& place, ParameterSpec spec) {
    spec.name = SuspectName(place.name, searched);
    suspects.push_back(std::move(spec));
  };
  for (const SuspectedField& place : SuspectedFields(model)) {
    ParameterSpec spec;
    const auto fields = FieldsOf(model, place, spec);
    if (!fields) continue;
    if (std::ranges::none_of(*fields, is_taken)) {
      add(place, spec);
      continue;
    }
    for (const SuspectedField& one : OneByOne(model, place, spec.field)) {
      const auto own = FieldsOf(model, one, spec);
      if (own && std::ranges::none_of(*own, is_taken)) add(one, spec);
    }
  }
  return suspects;
}

}  // namespace oted
