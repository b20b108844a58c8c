#include "oted/sim/mujoco/model_suspects.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "oted/base/error.h"
#include "oted/sim/mujoco/force_limits.h"
#include "oted/sim/mujoco/model_field.h"
#include "oted/sim/mujoco/model_scale.h"
#include "oted/sim/mujoco/object_path.h"

namespace oted {
namespace {

constexpr int kMostBodies = 12;  // whose masses, centres of mass and places are suspected one by one
constexpr int kMostSingly = 8;   // joints, drives or tendons that are, where others of them are searched
constexpr double kLow = 0.1, kHigh = 10.0;
constexpr double kNextToNone = 0.1 / kHigh;               // of the most there may be: multiples of it lead nowhere
constexpr double kLowestLimit = 1e-5, kHighestLimit = 2;  // of a force, times one that is never reached
constexpr double kMostLoadFriction = 0.9;                 // of the force of a joint's actuators
constexpr double kMostSpringOff = 1.0;                    // [rad], [m]: of where a spring rests
constexpr double kMostTendonOff = 0.3;                    // of its length: the same of a tendon's
constexpr double kMostTilt = 0.2;                         // of gravity: some eleven degrees
constexpr double kMostAside = 0.1;                        // of the model's extent
constexpr double kMostLoad = 2.0;                         // radii of gyration that a load moves a body's centre of mass
constexpr double kBesideAxis = 0.05;                      // of how far a centre of mass lies from its frame
constexpr double kFrictionShare = 0.1;  // of the torque that holds a mean body at the model's length against gravity

struct SuspectedField {
  std::string name, path;
  /// Where the model has none of it, or next to none: paths, of which the first that it has is suspected as a value.
  std::vector<std::string> if_zero = {};
  double most = 0;   ///< of it; without such a path: `path` itself, from that much less than in the model to more
  double limit = 0;  ///< of a force, hardly reached: a value near it or far below is suspected
};

std::vector<std::string> OfJoints(const std::string& field) { return {"joint/@actuated/" + field, "joint/*/" + field}; }

/// A body that is heavier is as a rule heavier all over.
std::string MassWithInertia(const std::string& body) { return fmt::format("body/{0}/mass + body/{0}/inertia", body); }

/// What a drive's gear is: of one that acts at a site any of six numbers.
std::string GearPath(const mjModel& model) {
  for (int i = 0; i < 6 * model.nactuator; ++i) {
    if (i % 6 != 0 && model.actuator_gear[i] != 0) return "actuator/*/gear";
  }
  return "actuator/*/gear[0]";
}

std::string CalledBody(const mjModel& model, int body) {
  const std::string object = ObjectName(model, mjOBJ_BODY, body);
  return object.starts_with("#") ? fmt::format("body{}", body) : object;
}

/// Where things stand that do not move, and a floor lies: of what the robot touches this is measured by hand.
void AddPlaces(const mjModel& model, std::vector<SuspectedField>& places) {
  const double most = RoundBound(kMostAside * model.stat.extent);
  const auto add = [&](const std::string& kind, const std::string& object, const std::string& called, int axis) {
    places.push_back(
        {fmt::format("{}_{}", called, "xyz"[axis]), fmt::format("{}/{}/pos[{}]", kind, object, axis), {}, most});
  };
  std::vector<int> of_world;
  for (int geom = 0; geom < model.ngeom; ++geom) {
    const bool touches = model.geom_contype[geom] != 0 || model.geom_conaffinity[geom] != 0;
    if (model.geom_bodyid[geom] == 0 && touches) of_world.push_back(geom);
  }
  if (of_world.size() <= static_cast<size_t>(kMostSingly)) {
    for (const int geom : of_world) {
      const std::string object = ObjectName(model, mjOBJ_GEOM, geom);
      const std::string called = object.starts_with("#") ? fmt::format("geom{}", geom) : object;
      // A plane has no end that could lie elsewhere.
      for (int axis = model.geom_type[geom] == mjGEOM_PLANE ? 2 : 0; axis < 3; ++axis)
        add("geom", object, called, axis);
    }
  }
  if (model.nbody - 1 > kMostBodies) return;
  for (int body = 1; body < model.nbody; ++body) {
    if (model.body_weldid[body] != 0 || model.body_parentid[body] != 0) continue;
    for (int axis = 0; axis < 3; ++axis) {
      add("body", ObjectName(model, mjOBJ_BODY, body), CalledBody(model, body), axis);
    }
  }
}

/// Where the springs of single joints rest.
void AddSprings(const mjModel& model, std::vector<SuspectedField>& places) {
  const auto n_springs = std::count_if(model.jnt_stiffness, model.jnt_stiffness + model.njnt,
                                       [](double stiffness) { return stiffness != 0; });
  if (n_springs > kMostSingly) return;
  for (int joint = 0; joint < model.njnt; ++joint) {
    if (model.jnt_stiffness[joint] == 0) continue;
    const std::string name = ObjectName(model, mjOBJ_JOINT, joint);
    places.push_back({name + "_springref", fmt::format("joint/{}/springref", name), {}, kMostSpringOff});
  }
}

/// The length at which the springs of single tendons rest. Those with a dead band have two.
void AddTendonSprings(const mjModel& model, std::vector<SuspectedField>& places) {
  if (model.ntendon > kMostSingly) return;
  for (int tendon = 0; tendon < model.ntendon; ++tendon) {
    const double length = model.tendon_lengthspring[2 * tendon];
    if (model.tendon_stiffness[tendon] == 0 || length == 0 || length != model.tendon_lengthspring[2 * tendon + 1])
      continue;
    const std::string name = ObjectName(model, mjOBJ_TENDON, tendon);
    places.push_back({name + "_lengthspring",
                      fmt::format("tendon/{}/lengthspring", name),
                      {},
                      RoundBound(kMostTendonOff * std::abs(length))});
  }
}

/// Whether it is a base that moves, or nothing hangs on it: bodies that carry what no model knows of.
bool MayCarry(const mjModel& model, int body) {
  if (model.body_mass[body] <= 0 || model.body_weldid[body] == 0) return false;
  const bool is_base = model.body_parentid[body] == 0;
  return is_base || std::count(model.body_parentid + body + 1, model.body_parentid + model.nbody, body) == 0;
}

/// A body's centre of mass: a multiple of how far it lies along the axes that it lies on, and of a body that may carry
/// a load a shift along the others, where no multiple moves it.
void AddCentreOfMass(const mjModel& model, int body, std::vector<SuspectedField>& places) {
  const mjtNum *const centre = model.body_ipos + 3 * body, *const inertia = model.body_inertia + 3 * body;
  const double least = kBesideAxis * mju_norm3(centre);
  const std::string path = fmt::format("body/{}/ipos", ObjectName(model, mjOBJ_BODY, body));
  const std::string called = CalledBody(model, body) + "_com";
  const double radius = std::sqrt(std::max({inertia[0], inertia[1], inertia[2]}) / model.body_mass[body]);
  std::vector<std::string> along;
  for (int axis = 0; axis < 3; ++axis) {
    const std::string of_axis = fmt::format("{}[{}]", path, axis);
    if (MayCarry(model, body) && std::abs(centre[axis]) <= least) {
      places.push_back({fmt::format("{}_{}", called, "xyz"[axis]), of_axis, {}, RoundBound(kMostLoad * radius)});
    } else {
      along.push_back(of_axis);
    }
  }
  if (!along.empty()) {
    places.push_back({called, along.size() == 3 ? path : fmt::format("{}", fmt::join(along, " + "))});
  }
}

bool LacksForceLimits(const mjModel& model) {
  for (int actuator = 0; actuator < model.nactuator; ++actuator) {
    if (UnreachedForce(model, actuator) > 0) return true;
  }
  return false;
}

/// Limits of forces, of which some drives of the model have none.
void AddForceLimits(const mjModel& model, std::vector<SuspectedField>& places) {
  if (model.nactuator > kMostSingly) return;
  for (int actuator = 0; actuator < model.nactuator; ++actuator) {
    const mjtNum* range = model.actuator_forcerange + 2 * actuator;
    const bool has_limit = model.actuator_forcelimited[actuator] != 0;
    const double limit = has_limit ? range[1] : UnreachedForce(model, actuator);
    // Of two ends that differ no one value is the limit.
    if (has_limit ? limit > 0 && -range[0] != limit : limit == 0) continue;
    const std::string name = ObjectName(model, mjOBJ_ACTUATOR, actuator);
    places.push_back({name + "_force_limit", fmt::format("actuator/{}/force_limit", name), {}, 0, limit});
  }
}

std::vector<SuspectedField> SuspectedFields(const mjModel& model) {
  const double torque = RoundBound(kFrictionShare * HoldingTorque(model));
  const double tension = RoundBound(kFrictionShare * HoldingTension(model));
  std::vector<SuspectedField> places = {
      {"damping", "joint/*/damping", OfJoints("damping"), torque},
      {"armature", "joint/*/armature", OfJoints("armature"), RoundBound(model.stat.meaninertia)},
      {"frictionloss", "joint/*/frictionloss", OfJoints("frictionloss"), torque},
      {"load_friction", "joint/@actuated/load_friction", OfJoints("load_friction"), kMostLoadFriction},
      {"stribeck_torque", "joint/@actuated/stribeck_torque", OfJoints("stribeck_torque"), torque},
      {"stiffness", "joint/*/stiffness", OfJoints("stiffness"), RoundBound(HoldingTorque(model))},
      {"gear", GearPath(model)},
      {"kp", "actuator/*/kp"},
      {"kv", "actuator/*/kv", {"actuator/*/kv"}, torque},
      {"friction", "geom/*/friction[0]"},
      {"contact_time", "geom/*/solref[0]"},
      {"contact_damping", "geom/*/solref[1]"},
      {"tendon_frictionloss", "tendon/*/frictionloss", {"tendon/*/frictionloss"}, tension},
      {"tendon_damping", "tendon/*/damping", {"tendon/*/damping"}, tension},
      {"tendon_stiffness", "tendon/*/stiffness"},
      {"equality_time", "equality/*/solref[0]"},
      {"equality_damping", "equality/*/solref[1]"},
      {"joint_force_limit", "joint/*/actfrcrange"},
      {"viscosity", "opt/viscosity"},
      {"density", "opt/density"},
      {"inertia", "body/*/inertia"},
      {"gravity", "opt/gravity[2]"}};
  if (LacksForceLimits(model)) {
    AddForceLimits(model, places);
  } else {
    places.push_back({"force_limit", "actuator/*/forcerange"});
  }
  if (model.na > 0) places.push_back({"drive_lag", "actuator/*/dynprm[0]"});
  AddSprings(model, places);
  AddTendonSprings(model, places);
  AddPlaces(model, places);
  if (const double down = std::abs(model.opt.gravity[2]);
      down > 0 && model.opt.gravity[0] == 0 && model.opt.gravity[1] == 0) {
    // A base that does not stand level, and a floor that is none.
    places.push_back({"tilt_x", "opt/gravity[0]", {}, RoundBound(kMostTilt * down)});
    places.push_back({"tilt_y", "opt/gravity[1]", {}, RoundBound(kMostTilt * down)});
  }
  if (model.nbody > 2) places.push_back({"mass_and_inertia", MassWithInertia("*")});
  if (model.nbody - 1 > kMostBodies) {
    places.push_back({"mass", "body/*/mass"});
    return places;
  }
  for (int body = 1; body < model.nbody; ++body) {
    const std::string object = ObjectName(model, mjOBJ_BODY, body), called = CalledBody(model, body);
    places.push_back({called + "_mass", fmt::format("body/{}/mass", object)});
    places.push_back({called + "_mass_and_inertia", MassWithInertia(object)});
    AddCentreOfMass(model, body, places);
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

double Largest(const std::vector<ModelField>& fields) {
  double largest = 0;
  for (const ModelField& field : fields) {
    for (const double value : field.nominal) largest = std::max(largest, std::abs(value));
  }
  return largest;
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
    std::optional<std::vector<ModelField>> fields = Resolved(model, spec);
    if (fields) {
      spec.low += spec.nominal;
      spec.high += spec.nominal;
    }
    return fields;
  }
  if (place.limit > 0) {
    spec = {.name = place.name,
            .field = place.path,
            .low = kLowestLimit * place.limit,
            .high = kHighestLimit * place.limit,
            .scale = ParameterScale::kAbsolute,
            .logarithmic = true,
            .nominal = place.limit};
    std::vector<ModelField> fields = ResolvePath(model, spec.field);
    spec.unit = fields.front().unit;
    return fields;
  }
  spec = {.name = place.name, .field = place.path, .low = kLow, .high = kHigh, .logarithmic = true};
  std::optional<std::vector<ModelField>> multiple = Resolved(model, spec);
  if (multiple && Largest(*multiple) >= kNextToNone * place.most) return multiple;
  for (const std::string& path : place.if_zero) {
    ParameterSpec value = {
        .name = place.name, .field = path, .low = 0, .high = place.most, .scale = ParameterScale::kAbsolute};
    std::optional<std::vector<ModelField>> fields = Resolved(model, value);
    if (!fields) continue;
    if (value.nominal < 0 || value.nominal >= kNextToNone * place.most) break;
    spec = value;
    return fields;
  }
  return multiple;
}

/// The same of each joint, drive, tendon or body alone: "joint/elbow/damping".
std::vector<SuspectedField> OneByOne(const mjModel& model, const SuspectedField& place, const std::string& path) {
  const std::vector<ObjectKind> kinds = {{"joint", mjOBJ_JOINT, static_cast<int>(model.njnt)},
                                         {"body", mjOBJ_BODY, static_cast<int>(model.nbody)},
                                         {"actuator", mjOBJ_ACTUATOR, static_cast<int>(model.nactuator)},
                                         {"tendon", mjOBJ_TENDON, static_cast<int>(model.ntendon)}};
  const size_t first = path.find('/'), last = path.rfind('/');
  const auto kind = std::ranges::find(kinds, path.substr(0, first), &ObjectKind::word);
  if (kind == kinds.end() || TiedPaths(path).size() > 1) return {};
  const std::vector<int> ids = MatchObjects(model, *kind, path.substr(first + 1, last - first - 1), path);
  if (ids.size() < 2 || ids.size() > static_cast<size_t>(kMostSingly)) return {};
  std::vector<SuspectedField> each;
  for (const int id : ids) {
    const std::string name = ObjectName(model, kind->type, id);
    const std::string own = path.substr(0, first + 1) + name + path.substr(last);
    const std::vector<std::string> if_zero(place.if_zero.empty() ? 0 : 1, own);
    each.push_back({name + "_" + place.name, own, if_zero, place.most});
  }
  return each;
}

/// What is searched, and which numbers of the model.
struct Searched {
  const ParameterSpec& spec;
  Places places;

  bool Has(const Places& suspected) const {
    return std::ranges::any_of(suspected, [&](const auto& place) { return places.contains(place); });
  }
  /// Whether a suspect may multiply a part of what it gives.
  bool LeavesPart(const ParameterSpec& suspect, const Places& suspected) const {
    return spec.IsMultiple() && suspect.IsMultiple() && IsPartOf(suspected, places);
  }
};

/// What may be suspected beside the parameters of `space`.
class Suspecting {
 public:
  Suspecting(const mjModel& model, const ParameterSpace& space) : model_(model), space_(space) {
    for (const ParameterSpec& spec : space.specs()) {
      // What is known of each recording nobody doubts, and it may multiply what is.
      if (spec.is_known && spec.IsMultiple()) continue;
      searched_.push_back({spec, PlacesOf(ResolvePath(model, spec.field))});
    }
  }

  std::vector<ParameterSpec> All() const {
    std::vector<ParameterSpec> suspects;
    for (const SuspectedField& place : SuspectedFields(model_)) {
      ParameterSpec spec;
      if (!FieldsOf(model_, place, spec)) continue;
      if (!Add(place, suspects)) AddEach(place, spec.field, suspects);
    }
    return suspects;
  }

  std::vector<ParameterSpec> PartsOf(const ParameterSpec& whole) const {
    std::vector<ParameterSpec> parts;
    const auto is_of = [&](const SuspectedField& place) {
      return place.path == whole.field || std::ranges::find(place.if_zero, whole.field) != place.if_zero.end();
    };
    const std::vector<SuspectedField> all = SuspectedFields(model_);
    if (const auto place = std::ranges::find_if(all, is_of); place != all.end()) AddEach(*place, whole.field, parts);
    return parts;
  }

 private:
  /// @return whether it may be
  bool Add(const SuspectedField& place, std::vector<ParameterSpec>& suspects) const {
    ParameterSpec spec;
    const auto fields = FieldsOf(model_, place, spec);
    if (!fields) return false;
    const Places places = PlacesOf(*fields);
    std::vector<std::string> multiplied;
    for (const Searched& searched : searched_) {
      if (!searched.Has(places)) continue;
      if (!searched.LeavesPart(spec, places)) return false;
      multiplied.push_back(searched.spec.name);
    }
    if (!multiplied.empty()) spec.unit = UnitOfMultiple(multiplied);
    spec.name = place.name;
    suspects.push_back(spec);
    return true;
  }

  void AddEach(const SuspectedField& place, const std::string& path, std::vector<ParameterSpec>& suspects) const {
    for (const SuspectedField& one : OneByOne(model_, place, path)) Add(one, suspects);
  }

  const mjModel& model_;
  const ParameterSpace& space_;
  std::vector<Searched> searched_;
};

}  // namespace

std::vector<ParameterSpec> ModelSuspects(const mjModel& model, const ParameterSpace& space) {
  return Suspecting(model, space).All();
}

std::vector<ParameterSpec> PartsOfSuspect(const mjModel& model, const ParameterSpace& space,
                                          const ParameterSpec& suspect) {
  return Suspecting(model, space).PartsOf(suspect);
}

}  // namespace oted
