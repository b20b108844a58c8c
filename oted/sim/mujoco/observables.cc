#include "oted/sim/mujoco/observables.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/sim/mujoco/object_path.h"

namespace oted {
namespace {

// Where the numbers of one object lie in an array.
struct Place {
  int first = 0;
  int size = 0;
};

// A field of one kind of object.
struct ObservableField {
  const char* owner;
  const char* name;
  const char* array;
  int stage;
  Place (*place)(const mjModel& model, int id);
  StatePart part = StatePart::kNone;
};

int PositionsOf(int joint_type) { return joint_type == mjJNT_FREE ? 7 : joint_type == mjJNT_BALL ? 4 : 1; }
int VelocitiesOf(int joint_type) { return joint_type == mjJNT_FREE ? 6 : joint_type == mjJNT_BALL ? 3 : 1; }

Place JointPositions(const mjModel& m, int id) { return {m.jnt_qposadr[id], PositionsOf(m.jnt_type[id])}; }
Place JointVelocities(const mjModel& m, int id) { return {m.jnt_dofadr[id], VelocitiesOf(m.jnt_type[id])}; }
Place ActuatorOutputs(const mjModel& m, int id) { return {m.actuator_outadr[id], m.actuator_outnum[id]}; }
Place ActuatorStates(const mjModel& m, int id) {
  return {std::max(0, m.actuator_actadr[id]), m.actuator_actadr[id] < 0 ? 0 : m.actuator_actnum[id]};
}
Place One(const mjModel&, int id) { return {id, 1}; }
Place Three(const mjModel&, int id) { return {3 * id, 3}; }
Place Four(const mjModel&, int id) { return {4 * id, 4}; }

const std::vector<ObservableField>& Fields() {
  static const std::vector<ObservableField> fields = {
      {"joint", "qpos", "qpos", mjSTAGE_NONE, JointPositions, StatePart::kQpos},
      {"joint", "qvel", "qvel", mjSTAGE_NONE, JointVelocities, StatePart::kQvel},
      {"joint", "qacc", "qacc", mjSTAGE_ACC, JointVelocities},
      {"joint", "qfrc_actuator", "qfrc_actuator", mjSTAGE_ACC, JointVelocities},
      {"body", "xpos", "xpos", mjSTAGE_POS, Three},
      {"body", "xquat", "xquat", mjSTAGE_POS, Four},
      {"body", "subtree_com", "subtree_com", mjSTAGE_POS, Three},
      {"site", "xpos", "site_xpos", mjSTAGE_POS, Three},
      {"site", "xquat", "site_xquat", mjSTAGE_POS, Four},
      {"geom", "xpos", "geom_xpos", mjSTAGE_POS, Three},
      {"geom", "xquat", "geom_xquat", mjSTAGE_POS, Four},
      {"actuator", "force", "actuator_force", mjSTAGE_ACC, ActuatorOutputs},
      {"actuator", "length", "actuator_length", mjSTAGE_POS, ActuatorOutputs},
      {"actuator", "velocity", "actuator_velocity", mjSTAGE_VEL, ActuatorOutputs},
      {"actuator", "act", "act", mjSTAGE_NONE, ActuatorStates, StatePart::kAct},
      {"tendon", "length", "ten_length", mjSTAGE_POS, One},
      {"tendon", "velocity", "ten_velocity", mjSTAGE_VEL, One}};
  return fields;
}

std::vector<ObjectKind> Kinds(const mjModel& m) {
  return {{"joint", mjOBJ_JOINT, static_cast<int>(m.njnt)},
          {"body", mjOBJ_BODY, static_cast<int>(m.nbody)},
          {"site", mjOBJ_SITE, static_cast<int>(m.nsite)},
          {"geom", mjOBJ_GEOM, static_cast<int>(m.ngeom)},
          {"actuator", mjOBJ_ACTUATOR, static_cast<int>(m.nactuator)},
          {"tendon", mjOBJ_TENDON, static_cast<int>(m.ntendon)},
          {"sensor", mjOBJ_SENSOR, static_cast<int>(m.nsensor)}};
}

void Append(const Place& place, int index, const Observable& proto, std::vector<Observable>& out) {
  for (int k = 0; k < place.size; ++k) {
    if (index >= 0 && k != index) continue;
    out.push_back(proto);
    out.back().index = place.first + k;
    if (place.size > 1) out.back().name += fmt::format("[{}]", k);
  }
}

std::vector<Observable> ResolveSensor(const mjModel& m, const ObjectKind& kind, const std::string& rest,
                                      const std::string& what) {
  const FieldRef ref = ParseField(rest, what);
  std::vector<Observable> found;
  int largest = 0;
  for (const int id : MatchObjects(m, kind, ref.name, what)) {
    const Observable proto{
        .name = "sensor/" + ObjectName(m, mjOBJ_SENSOR, id), .array = "sensordata", .stage = m.sensor_needstage[id]};
    Append({m.sensor_adr[id], m.sensor_dim[id]}, ref.index, proto, found);
    largest = std::max(largest, m.sensor_dim[id]);
  }
  if (found.empty()) {
    throw UsageError(fmt::format("{}: got index {}, wanted 0 to {}", what, ref.index, largest - 1));
  }
  return found;
}

}  // namespace

std::vector<Observable> ResolveObservable(const mjModel& model, const std::string& path, const std::string& what) {
  const std::vector<ObjectKind> kinds = Kinds(model);
  const size_t first = path.find('/'), last = path.rfind('/');
  const std::string word = path.substr(0, first);
  const auto kind = std::find_if(kinds.begin(), kinds.end(), [&](const ObjectKind& k) { return word == k.word; });
  if (kind == kinds.end()) {
    std::vector<std::string> words;
    for (const ObjectKind& k : kinds) words.emplace_back(k.word);
    throw UsageError(fmt::format("{}: unknown owner '{}'{}; there are {}", what, word, DidYouMean(word, words),
                                 fmt::join(words, ", ")));
  }
  if (first == std::string::npos || first + 1 == path.size()) {
    throw UsageError(fmt::format("{}: names no {}; write {}/NAME, with * for all of them", what, word, word));
  }
  if (word == "sensor") return ResolveSensor(model, *kind, path.substr(first + 1), what);
  std::vector<std::string> names;
  for (const ObservableField& f : Fields()) {
    if (word == f.owner) names.emplace_back(f.name);
  }
  if (first == last) {
    throw UsageError(fmt::format("{}: names no field; write {}/FIELD, where FIELD is one of {}", what, path,
                                 fmt::join(names, ", ")));
  }
  const FieldRef ref = ParseField(std::string_view(path).substr(last + 1), what);
  const auto field = std::find_if(Fields().begin(), Fields().end(),
                                  [&](const ObservableField& f) { return word == f.owner && ref.name == f.name; });
  if (field == Fields().end()) {
    throw UsageError(fmt::format("{}: a {} has no '{}'{}; it has {}", what, word, ref.name, DidYouMean(ref.name, names),
                                 fmt::join(names, ", ")));
  }
  std::vector<Observable> found;
  int largest = 0;
  for (const int id : MatchObjects(model, *kind, std::string_view(path).substr(first + 1, last - first - 1), what)) {
    const Place place = field->place(model, id);
    const Observable proto{.name = fmt::format("{}/{}/{}", word, ObjectName(model, kind->type, id), field->name),
                           .array = field->array,
                           .stage = field->stage,
                           .part = field->part};
    Append(place, ref.index, proto, found);
    largest = std::max(largest, place.size);
  }
  if (found.empty()) {
    throw UsageError(largest == 0 ? fmt::format("{}: no {} that it matches has a '{}'", what, word, field->name)
                                  : fmt::format("{}: got index {}, wanted 0 to {}", what, ref.index, largest - 1));
  }
  return found;
}

Observable AsState(const mjModel& model, const Observable& observable) {
  if (observable.array != "sensordata") return observable;
  for (int id = 0; id < model.nsensor; ++id) {
    if (model.sensor_adr[id] != observable.index || model.sensor_cutoff[id] > 0 || model.sensor_historyadr[id] >= 0) {
      continue;
    }
    const int joint = model.sensor_objid[id];
    Observable state = observable;
    if (model.sensor_type[id] == mjSENS_JOINTPOS) {
      state.array = "qpos";
      state.part = StatePart::kQpos;
      state.index = model.jnt_qposadr[joint];
    } else if (model.sensor_type[id] == mjSENS_JOINTVEL) {
      state.array = "qvel";
      state.part = StatePart::kQvel;
      state.index = model.jnt_dofadr[joint];
    }
    return state;
  }
  return observable;
}

}  // namespace oted
