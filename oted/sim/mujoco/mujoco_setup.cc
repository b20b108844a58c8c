#include "oted/sim/mujoco/mujoco_setup.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "oted/base/error.h"
#include "oted/sim/mujoco/force_limits.h"
#include "oted/sim/mujoco/gymnasium_rules.h"
#include "oted/sim/mujoco/object_path.h"
#include "oted/sim/mujoco/task.h"

namespace oted {
namespace {

// "rootz_pos", ..., "rootx_vel", ...: all joints of these models have one degree of freedom.
std::vector<std::string> ObservationNames(const mjModel& model) {
  std::vector<std::string> names;
  const auto joint = [&](int id) { return std::string(mj_id2name(&model, mjOBJ_JOINT, id)); };
  for (int i = 1; i < model.njnt; ++i) names.push_back(joint(i) + "_pos");
  for (int i = 0; i < model.njnt; ++i) names.push_back(joint(i) + "_vel");
  return names;
}

// Parallel to the names.
std::vector<std::string> ObservationUnits(const mjModel& model) {
  std::vector<std::string> units;
  const auto unit = [&](int id) { return std::string(model.jnt_type[id] == mjJNT_SLIDE ? "m" : "rad"); };
  for (int i = 1; i < model.njnt; ++i) units.push_back(unit(i));
  for (int i = 0; i < model.njnt; ++i) units.push_back(unit(i) + "/s");
  return units;
}

// An actuator's name, or that of the joint which it drives: the motors of Hopper and Walker2d have none.
std::string ActionName(const mjModel& model, int actuator) {
  const char* name = mj_id2name(&model, mjOBJ_ACTUATOR, actuator);
  if (name != nullptr && *name != '\0') return name;
  const int joint = model.actuator_trnid[2 * actuator];
  const int transmission = model.actuator_trntype[actuator];
  if (transmission == mjTRN_JOINT || transmission == mjTRN_JOINTINPARENT) name = mj_id2name(&model, mjOBJ_JOINT, joint);
  return name != nullptr && *name != '\0' ? name : fmt::format("actuator{}", actuator);
}

SimulatorSpec MakeSpec(const MujocoTask& task, const mjModel& model) {
  SimulatorSpec spec;
  spec.task = task.name;
  spec.observation_shape = {static_cast<int>(model.nq + model.nv) - 1};
  spec.observation_names = ObservationNames(model);
  spec.observation_units = ObservationUnits(model);
  spec.act_dim = static_cast<int>(model.nu);
  for (int i = 0; i < model.nu; ++i) {
    spec.action_names.push_back(ActionName(model, i));
    spec.action_low.push_back(model.actuator_ctrlrange[2 * i]);
    spec.action_high.push_back(model.actuator_ctrlrange[2 * i + 1]);
  }
  spec.control_period_s = model.opt.timestep * task.frame_skip;
  spec.physics_steps = task.frame_skip;
  spec.step_weight = StepWeight(model);
  spec.max_episode_steps = task.max_episode_steps;
  spec.can_set_state = true;
  // These models have one velocity per position, and do not show the first position.
  spec.rate_of.assign(static_cast<size_t>(spec.obs_dim()), -1);
  for (int i = 1; i < model.nv; ++i) spec.rate_of[static_cast<size_t>(model.nq - 1 + i)] = i - 1;
  spec.return_random = task.return_random;
  spec.return_expert = task.return_expert;
  return spec;
}

std::string CommonPlace(const ModelField& a, const ModelField& b) {
  for (size_t k = 0; k < a.indices.size(); ++k) {
    if (std::ranges::binary_search(b.indices, a.indices[k])) return a.places[k];
  }
  return a.array;
}

// Multiples of one place multiply each other. With a value there the result would depend on their order.
void CheckShared(const std::vector<ParameterSpec>& specs, const std::vector<ModelField>& fields) {
  for (size_t i = 0; i < fields.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      const ParameterSpec &one = specs[fields[j].parameter], &other = specs[fields[i].parameter];
      if (one.IsMultiple() && other.IsMultiple()) continue;
      if (fields[i].parameter == fields[j].parameter || !SharePlace(fields[i], fields[j])) continue;
      throw UsageError(
          fmt::format("parameters '{}' ({}) and '{}' ({}) both set {}; narrow one of the paths, or make "
                      "both multiples of nominal",
                      one.name, one.field, other.name, other.field, CommonPlace(fields[i], fields[j])));
    }
  }
}

/// A multiple of which every number is another one's too is one of what that gives. Of two alike the later is.
void NameWhatIsMultiplied(const std::vector<Places>& places, std::vector<ParameterSpec>& specs) {
  for (size_t i = 0; i < specs.size(); ++i) {
    std::vector<std::string> multiplied;
    for (size_t j = 0; j < specs.size(); ++j) {
      if (i == j || !specs[j].IsMultiple() || specs[j].is_known) continue;
      const bool is_repeated = places[j] == places[i] && j < i;
      if (is_repeated || IsPartOf(places[i], places[j])) multiplied.push_back(specs[j].name);
    }
    if (specs[i].IsMultiple() && !specs[i].is_known) specs[i].unit = UnitOfMultiple(multiplied);
  }
}

/// The bodies that MuJoCo takes for simple and whose frame of inertia a parameter moves.
std::set<int> SimpleBodiesMoved(const mjModel& model, std::vector<ParameterSpec> specs) {
  std::set<int> bodies;
  for (ParameterSpec& spec : specs) {
    for (const ModelField& field : ResolveParameter(model, spec)) {
      const int size = field.array == "body_ipos" ? 3 : field.array == "body_iquat" ? 4 : 0;
      if (size == 0) continue;
      for (const int at : field.indices) {
        if (model.body_simple[at / size] != 0) bodies.insert(at / size);
      }
    }
  }
  return bodies;
}

}  // namespace

void LetInertiaMove(const std::vector<ParameterSpec>& specs, LoadedModel& loaded) {
  const std::set<int> bodies = SimpleBodiesMoved(*loaded.model, specs);
  if (!bodies.empty()) LetInertiaMove(loaded, bodies);
}

std::vector<double> FixedState(const mjModel& model, int key) {
  DataPtr data(mj_makeData(&model));
  OTED_CHECK(data != nullptr);
  if (key >= 0) mj_resetDataKeyframe(&model, data.get(), key);
  std::vector<double> state(static_cast<size_t>(mj_stateSize(&model, mjSTATE_INTEGRATION)));
  mj_getState(&model, data.get(), state.data(), mjSTATE_INTEGRATION);
  return state;
}

double StepWeight(const mjModel& model) {
  const double walker = 4.0 * 9 * 9, evaluations = model.opt.integrator == mjINT_RK4 ? 4 : 1;
  return std::max(1.0, evaluations * model.nv * model.nv / walker);
}

void AddParameters(std::vector<ParameterSpec> specs, MujocoSetup& setup) {
  std::vector<Places> places;
  for (size_t i = 0; i < specs.size(); ++i) {
    std::vector<ModelField> fields = ResolveParameter(*setup.loaded.model, specs[i]);
    places.push_back(PlacesOf(fields));
    for (ModelField& field : fields) {
      field.parameter = i;
      setup.fields.push_back(std::move(field));
    }
  }
  CheckShared(specs, setup.fields);
  NameWhatIsMultiplied(places, specs);
  setup.space = ParameterSpace(std::move(specs));
  // Bounding boxes are not kept up to date with sizes; without the middle phase nothing reads them.
  if (std::ranges::any_of(setup.fields, [](const ModelField& f) { return f.array == "geom_size"; })) {
    setup.loaded.model->opt.disableflags |= mjDSBL_MIDPHASE;
  }
}

std::shared_ptr<const MujocoSetup> MakeMujocoSetup(const std::string& name, std::vector<ParameterSpec> specs) {
  auto setup = std::make_shared<MujocoSetup>();
  const MujocoTask& task = FindTask(name);
  for (const ParameterSpec& spec : specs) spec.Check();
  setup->model_path = AssetFolder() / task.xml_file;
  setup->loaded = LoadModel(setup->model_path, task.legacy_capsules);
  LetForcesBeLimited(specs, setup->loaded);
  LetInertiaMove(specs, setup->loaded);
  const mjModel& model = *setup->loaded.model;
  AddParameters(std::move(specs), *setup);
  setup->spec = MakeSpec(task, model);
  setup->start_state = FixedState(model);
  setup->frame_skip = task.frame_skip;
  setup->controls.resize(static_cast<size_t>(model.nu));
  std::iota(setup->controls.begin(), setup->controls.end(), 0);
  // Tasks are never destroyed.
  setup->make_rules = [&task, period = setup->spec.control_period_s] {
    return std::make_unique<GymnasiumRules>(task, period);
  };
  return setup;
}

}  // namespace oted
