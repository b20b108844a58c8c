#include "oted/sim/mujoco/model_field.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <mujoco/mjxmacro.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <set>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/sim/mujoco/drive_kind.h"
#include "oted/sim/mujoco/field_info.h"
#include "oted/sim/mujoco/joint_friction.h"
#include "oted/sim/mujoco/joint_residual.h"
#include "oted/sim/mujoco/object_path.h"
#include "oted/sim/mujoco/tendon_joints.h"

namespace oted {
namespace {

// A floating-point array of mjModel, or one that it lacks (joint_friction.h, joint_residual.h): n rows of `width`
// numbers.
struct ModelArray {
  std::string name;
  const double* values;  // null: all of them are `value`
  int n;
  int width;
  double value = 0;

  double operator[](int i) const { return values == nullptr ? value : values[i]; }
};

void AddArray(std::vector<ModelArray>& arrays, const char* name, const double* values, int n, int width) {
  arrays.push_back({.name = name, .values = values, .n = n, .width = width});
}
// Integers, flags and colours are structure, not parameters.
template <class T>
void AddArray(std::vector<ModelArray>&, const char*, const T*, int, int) {}

std::vector<ModelArray> ModelArrays(const mjModel& model) {
  std::vector<ModelArray> arrays;
#undef MJ_M
#define MJ_M(n) model.n
#define X(type, name, nr, nc) AddArray(arrays, #name, model.name, static_cast<int>(model.nr), static_cast<int>(nc));
  MJMODEL_POINTERS
#undef X
#undef MJ_M
#define MJ_M(n) n
  arrays.push_back(
      {.name = kResidualArray, .values = nullptr, .n = static_cast<int>(model.nv), .width = kResidualSize});
  for (const auto& [name, nominal] : kFrictionArrays) {
    arrays.push_back({.name = name, .values = nullptr, .n = static_cast<int>(model.nv), .width = 1, .value = nominal});
  }
  return arrays;
}

std::vector<ModelArray> OptionArrays(const mjModel& model) {
  std::vector<ModelArray> arrays;
#define X(type, name, n) AddArray(arrays, #name, &model.opt.name, 1, n);
#define XVEC(type, name, n) AddArray(arrays, #name, model.opt.name, 1, n);
  MJOPTION_FIELDS
#undef XVEC
#undef X
  return arrays;
}

// The kinds of objects that a path can name.
struct Owner {
  const char* word;
  mjtObj type;
  int count;
  std::vector<const char*> prefixes;
};

std::vector<Owner> Owners(const mjModel& model) {
  return {{"geom", mjOBJ_GEOM, static_cast<int>(model.ngeom), {"geom_"}},
          {"body", mjOBJ_BODY, static_cast<int>(model.nbody), {"body_"}},
          {"joint", mjOBJ_JOINT, static_cast<int>(model.njnt), {"jnt_", "dof_"}},
          {"actuator", mjOBJ_ACTUATOR, static_cast<int>(model.nactuator), {"actuator_"}},
          {"site", mjOBJ_SITE, static_cast<int>(model.nsite), {"site_"}},
          {"tendon", mjOBJ_TENDON, static_cast<int>(model.ntendon), {"tendon_"}},
          {"equality", mjOBJ_EQUALITY, static_cast<int>(model.neq), {"eq_"}},
          {"pair", mjOBJ_UNKNOWN, static_cast<int>(model.npair), {"pair_"}}};
}

// What MuJoCo computes from other fields or never reads in the dynamics, and the time step: with it the control period,
// and what an action is, would change.
const std::set<std::string, std::less<>> kNotParameters = {
    "body_subtreemass", "body_invweight0",  "body_user",      "jnt_user",          "dof_invweight0", "dof_M0",
    "dof_length",       "geom_aabb",        "geom_rbound",    "geom_user",         "site_user",      "actuator_user",
    "actuator_acc0",    "actuator_length0", "tendon_length0", "tendon_invweight0", "tendon_user",    "timestep"};

// mj_setConst reads these (kinematics and inertia in the reference pose).
const std::set<std::string, std::less<>> kConstantsDependOn = {
    "body_mass",    "body_inertia",  "body_ipos",    "body_iquat",        "body_pos",        "body_quat",
    "jnt_pos",      "jnt_axis",      "dof_armature", "geom_pos",          "geom_quat",       "site_pos",
    "site_quat",    "actuator_gear", "eq_data",      "actuator_armature", "tendon_armature", "actuator_cranklength",
    "body_gravcomp"};

// The array that `field` means, among those with one of `prefixes`.
const ModelArray& FindArray(const std::vector<ModelArray>& arrays, const std::vector<const char*>& prefixes,
                            const std::string& field, const std::string& path) {
  std::vector<std::string> candidates;
  for (const char* prefix : prefixes) {
    for (const ModelArray& array : arrays) {
      if (!array.name.starts_with(prefix) || kNotParameters.contains(array.name) || array.width == 0) continue;
      const std::string short_name = array.name.substr(std::string_view(prefix).size());
      if (short_name == field) return array;
      candidates.push_back(short_name);
    }
  }
  throw UsageError(fmt::format("parameter path '{}': no field '{}'{}; there are {}", path, field,
                               DidYouMean(field, candidates), fmt::join(candidates, ", ")));
}

// `prefix` is the path of a row's object, "geom/foot_geom".
ModelField Collect(const ModelArray& array, std::string expand_name, const std::vector<int>& rows, int index,
                   const std::string& field_name, const std::function<std::string(int row)>& prefix,
                   const std::string& path) {
  if (index >= array.width) {
    throw UsageError(fmt::format("parameter path '{}': got index {}, wanted 0 to {}", path, index, array.width - 1));
  }
  ModelField field;
  field.array = std::move(expand_name);
  for (int row : rows) {
    for (int column = 0; column < array.width; ++column) {
      if (index >= 0 && column != index) continue;
      field.indices.push_back(row * array.width + column);
      const std::string place = prefix(row) + "/" + field_name;
      field.places.push_back(array.width > 1 ? fmt::format("{}[{}]", place, column) : place);
    }
  }
  for (int i : field.indices) field.nominal.push_back(array[i]);
  field.unit = DescribeField(array.name, index).unit;
  field.changes_constants = kConstantsDependOn.contains(array.name);
  return field;
}

// Whether a tendon's length is one: of a spatial one, or of joints that all slide. With a hinge in it, it is an angle.
bool IsLength(const mjModel& model, int tendon) {
  return std::ranges::none_of(JointsOfTendon(model, tendon),
                              [&](const TendonJoint& joint) { return model.jnt_type[joint.id] == mjJNT_HINGE; });
}

// Of two units, sliding and turning, the one that holds for all of `ids`; both where they differ.
std::string UnitFor(const mjModel& model, const Owner& owner, const std::vector<int>& ids, const std::string& unit) {
  const auto slides = [&](int id) {
    if (owner.type == mjOBJ_JOINT) return model.jnt_type[id] == mjJNT_SLIDE;
    if (owner.type == mjOBJ_TENDON) return IsLength(model, id);
    const int transmission = model.actuator_trntype[id], target = model.actuator_trnid[2 * id];
    if (transmission == mjTRN_TENDON) return IsLength(model, target);
    const bool of_joint = transmission == mjTRN_JOINT || transmission == mjTRN_JOINTINPARENT;
    return of_joint && model.jnt_type[target] == mjJNT_SLIDE;
  };
  if (owner.type != mjOBJ_JOINT && owner.type != mjOBJ_ACTUATOR && owner.type != mjOBJ_TENDON) return unit;
  const auto n_sliding = std::count_if(ids.begin(), ids.end(), slides);
  const bool alike = n_sliding == 0 || n_sliding == static_cast<ptrdiff_t>(ids.size());
  return alike ? PickUnit(unit, n_sliding > 0) : unit;
}

// Rows of `array` that belong to the objects `ids`: a joint owns one row per degree of freedom in dof_ arrays.
std::vector<int> RowsOf(const mjModel& model, const Owner& owner, const ModelArray& array, const std::vector<int>& ids,
                        const std::string& path) {
  if (!array.name.starts_with("dof_")) {
    if (array.n != owner.count) {
      throw UsageError(
          fmt::format("parameter path '{}': this model's {}s have several controls or outputs each, so '{}' "
                      "has no row per {}",
                      path, owner.word, array.name, owner.word));
    }
    return ids;
  }
  std::vector<int> rows;
  for (int dof = 0; dof < array.n; ++dof) {
    if (std::find(ids.begin(), ids.end(), model.dof_jntid[dof]) != ids.end()) rows.push_back(dof);
  }
  return rows;
}

// kp and kv of the drives among `ids`: of a position servo kp is gainprm[0] and -biasprm[1], and kv -biasprm[2]; of a
// velocity servo kv is gainprm[0] and -biasprm[2]; of a motor with back-EMF kv is -biasprm[2].
std::vector<ModelField> FeedbackFields(const mjModel& model, const Owner& owner, const std::vector<int>& ids,
                                       const std::string& which, const std::string& path) {
  std::vector<int> positions, velocities, damped;
  for (const int id : ids) {
    const DriveKind drive = DriveOf(model, id);
    if (drive == DriveKind::kPositionServo) positions.push_back(id);
    if (drive == DriveKind::kVelocityServo) velocities.push_back(id);
    if (drive == DriveKind::kPositionServo || DampingOfDrive(model, id) != 0) damped.push_back(id);
  }
  const bool stiffness = which == "kp";
  if (stiffness ? positions.empty() : damped.empty()) {
    throw UsageError(fmt::format("parameter path '{}': no such actuator is {}; a motor's strength is gainprm[0]", path,
                                 stiffness ? "a position servo (gainprm[0] = kp = -biasprm[1])"
                                           : "a position servo, a velocity servo (gainprm[0] = kv = -biasprm[2]) or a "
                                             "motor with back-EMF (biasprm[2] = -kv)"));
  }
  const auto prefix = [&](int row) { return fmt::format("{}/{}", owner.word, ObjectName(model, owner.type, row)); };
  const ModelArray gains{
      .name = "actuator_gainprm", .values = model.actuator_gainprm, .n = owner.count, .width = mjNGAIN};
  const ModelArray biases{
      .name = "actuator_biasprm", .values = model.actuator_biasprm, .n = owner.count, .width = mjNBIAS};
  std::vector<ModelField> fields;
  const auto add = [&](const ModelArray& array, const std::vector<int>& rows, int column, const char* name,
                       double sign) {
    if (rows.empty()) return;
    fields.push_back(Collect(array, array.name, rows, column, name, prefix, path));
    fields.back().sign = sign;
    fields.back().unit = UnitFor(model, owner, ids, stiffness ? "N/m | N m/rad" : "N s/m | N m s/rad");
  };
  if (stiffness) {
    add(gains, positions, 0, "gainprm", 1);
    add(biases, positions, 1, "biasprm", -1);
  } else {
    add(gains, velocities, 0, "gainprm", 1);
    add(biases, damped, 2, "biasprm", -1);
  }
  return fields;
}

// Both ends of the actuators' forces. @param index  that a path gave: there is none
std::vector<ModelField> ForceLimit(const mjModel& model, const Owner& owner, const std::vector<int>& ids, int index,
                                   const std::string& path) {
  if (index >= 0) throw UsageError(fmt::format("parameter path '{}': force_limit has no index", path));
  const auto prefix = [&](int row) { return fmt::format("{}/{}", owner.word, ObjectName(model, owner.type, row)); };
  const ModelArray array{
      .name = "actuator_forcerange", .values = model.actuator_forcerange, .n = owner.count, .width = 2};
  std::vector<ModelField> fields;
  for (const int end : {0, 1}) {
    fields.push_back(Collect(array, array.name, ids, end, "forcerange", prefix, path));
    fields.back().sign = end == 0 ? -1 : 1;
    fields.back().unit = UnitFor(model, owner, ids, "N | N m");
  }
  return fields;
}

// Where the springs of the joints `ids` rest: MuJoCo keeps that by positions.
ModelField SpringReference(const mjModel& model, const Owner& owner, const std::vector<int>& ids, int index,
                           const std::string& path) {
  std::vector<int> joints, rows;
  for (const int id : ids) {
    if (model.jnt_type[id] != mjJNT_HINGE && model.jnt_type[id] != mjJNT_SLIDE) continue;
    joints.push_back(id);
    rows.push_back(model.jnt_qposadr[id]);
  }
  if (rows.empty()) throw UsageError(fmt::format("parameter path '{}': no such joint slides or is a hinge", path));
  const auto prefix = [&](int row) {
    const auto at = std::ranges::find(rows, row) - rows.begin();
    return "joint/" + ObjectName(model, mjOBJ_JOINT, joints[static_cast<size_t>(at)]);
  };
  const ModelArray array{
      .name = "qpos_spring", .values = model.qpos_spring, .n = static_cast<int>(model.nq), .width = 1};
  ModelField field = Collect(array, array.name, rows, index, "springref", prefix, path);
  field.unit = UnitFor(model, owner, joints, "m | rad");
  return field;
}

// One path, without ties.
std::vector<ModelField> ResolveOne(const mjModel& model, const std::string& path) {
  const size_t first = path.find('/');
  const size_t last = path.rfind('/');
  const std::string word = path.substr(0, first);
  const std::vector<Owner> owners = Owners(model);
  if (first == std::string::npos || last + 1 == path.size()) {
    throw UsageError(fmt::format(
        "parameter path '{}': wanted owner/objects/field or opt/field, for example geom/*/friction[0]", path));
  }
  const std::string what = fmt::format("parameter path '{}'", path);
  const FieldRef ref = ParseField(std::string_view(path).substr(last + 1), what);
  if (word == "opt" && first == last) {
    const std::vector<ModelArray> arrays = OptionArrays(model);
    const ModelArray& array = FindArray(arrays, {""}, ref.name, path);
    return {Collect(
        array, "opt." + array.name, {0}, ref.index, ref.name, [](int) { return "opt"; }, path)};
  }
  const auto owner = std::find_if(owners.begin(), owners.end(), [&](const Owner& o) { return word == o.word; });
  if (owner == owners.end()) {
    std::vector<std::string> words = {"opt"};
    for (const Owner& o : owners) words.emplace_back(o.word);
    throw UsageError(fmt::format("parameter path '{}': unknown owner '{}'{}; there are {}", path, word,
                                 DidYouMean(word, words), fmt::join(words, ", ")));
  }
  if (first == last) {
    throw UsageError(fmt::format("parameter path '{}': names no {}; write {}/*/{} for all of them", path, word, word,
                                 path.substr(first + 1)));
  }
  const std::vector<int> ids = MatchObjects(model, {owner->word, owner->type, owner->count},
                                            std::string_view(path).substr(first + 1, last - first - 1), what);
  if (owner->type == mjOBJ_ACTUATOR && (ref.name == "kp" || ref.name == "kv")) {
    if (ref.index >= 0) throw UsageError(fmt::format("parameter path '{}': {} has no index", path, ref.name));
    return FeedbackFields(model, *owner, ids, ref.name, path);
  }
  if (owner->type == mjOBJ_ACTUATOR && ref.name == "force_limit") {
    return ForceLimit(model, *owner, ids, ref.index, path);
  }
  if (owner->type == mjOBJ_JOINT && ref.name == "springref") {
    return {SpringReference(model, *owner, ids, ref.index, path)};
  }
  const std::vector<ModelArray> arrays = ModelArrays(model);
  const ModelArray& array = FindArray(arrays, owner->prefixes, ref.name, path);
  const std::vector<int> rows = RowsOf(model, *owner, array, ids, path);
  const bool per_dof = array.name.starts_with("dof_");
  const auto prefix = [&](int row) {
    const int id = per_dof ? model.dof_jntid[row] : row;
    const std::string dof = per_dof && model.jnt_type[id] <= mjJNT_BALL
                                ? fmt::format(" (dof {})", row - model.jnt_dofadr[id])
                                : std::string();
    return fmt::format("{}/{}{}", owner->word, ObjectName(model, owner->type, id), dof);
  };
  ModelField field = Collect(array, array.name, rows, ref.index, ref.name, prefix, path);
  field.unit = UnitFor(model, *owner, ids, field.unit);
  return {field};
}

}  // namespace

std::vector<ModelField> ResolvePath(const mjModel& model, const std::string& path) {
  std::vector<ModelField> all;
  for (const std::string& one : TiedPaths(path)) {
    for (ModelField& field : ResolveOne(model, one)) {
      for (const ModelField& other : all) {
        if (!SharePlace(field, other)) continue;
        throw UsageError(fmt::format("parameter path '{}': two of the paths name {}", path, field.places.front()));
      }
      all.push_back(std::move(field));
    }
  }
  return all;
}

bool SharePlace(const ModelField& a, const ModelField& b) {
  if (a.array != b.array) return false;
  return std::ranges::any_of(a.indices, [&](int i) { return std::ranges::binary_search(b.indices, i); });
}

Places PlacesOf(const std::vector<ModelField>& fields) {
  Places places;
  for (const ModelField& field : fields) {
    for (const int index : field.indices) places.emplace(field.array, index);
  }
  return places;
}

bool IsPartOf(const Places& part, const Places& whole) {
  return part.size() < whole.size() && std::ranges::includes(whole, part);
}

double BoundingRadius(int geom_type, const double* size, double otherwise) {
  switch (geom_type) {
    case mjGEOM_SPHERE:
      return size[0];
    case mjGEOM_CAPSULE:
      return size[0] + size[1];
    case mjGEOM_CYLINDER:
      return std::sqrt(size[0] * size[0] + size[1] * size[1]);
    case mjGEOM_ELLIPSOID:
      return std::max({size[0], size[1], size[2]});
    case mjGEOM_BOX:
      return std::sqrt(size[0] * size[0] + size[1] * size[1] + size[2] * size[2]);
    default:
      return otherwise;
  }
}

namespace {

/// What no body has less than nothing of: MuJoCo computes with it all the same.
void CheckSign(const ParameterSpec& spec, const std::vector<ModelField>& fields) {
  constexpr const char* kNeverNegative[] = {"body_mass",    "body_inertia",   "dof_damping",         "dof_frictionloss",
                                            "dof_armature", "tendon_damping", "tendon_frictionloss", "geom_friction",
                                            "opt.density",  "opt.viscosity"};
  const auto is_one = [&](const ModelField& field) {
    return std::ranges::find(kNeverNegative, field.array) != std::end(kNeverNegative);
  };
  if (spec.is_known || spec.low >= 0 || !std::ranges::any_of(fields, is_one)) return;
  throw UsageError(fmt::format("parameter '{}': got the lower bound {}, wanted 0 or more: '{}' cannot be negative",
                               spec.name, spec.low, spec.field));
}

}  // namespace

std::vector<ModelField> ResolveParameter(const mjModel& model, ParameterSpec& spec) {
  const std::vector<ModelField> fields = ResolvePath(model, spec.field);
  CheckSign(spec, fields);
  if (spec.IsMultiple()) {
    for (const ModelField& field : fields) {
      if (std::ranges::any_of(field.nominal, [](double value) { return value != 0; })) continue;
      throw UsageError(
          fmt::format("parameter '{}': the nominal value of '{}' is 0 and has no multiples; set scale = "
                      "\"absolute\" (':absolute' on the command line)",
                      spec.name, fields.size() == 1 ? spec.field : field.places.front()));
    }
    return fields;
  }
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const ModelField& field : fields) {
    for (const double value : field.nominal) {
      low = std::min(low, field.sign * value);
      high = std::max(high, field.sign * value);
    }
  }
  if (low != high) {
    throw UsageError(
        fmt::format("parameter '{}': '{}' matches values from {} to {}, which one absolute value cannot "
                    "stand for; narrow the path or use multiples of nominal",
                    spec.name, spec.field, low + 0.0, high));
  }
  if (spec.wanted_nominal && std::abs(*spec.wanted_nominal - low) > 1e-6 * std::abs(low) + 1e-12) {
    throw UsageError(fmt::format(
        "parameter '{}': the nominal value of '{}' is {} in the model, but {} in the parameter file; the file was made "
        "with another model: correct the one or the other",
        spec.name, spec.field, low, *spec.wanted_nominal));
  }
  spec.nominal = low + 0.0;  // no -0
  spec.unit = fields.front().unit;
  return fields;
}

}  // namespace oted
