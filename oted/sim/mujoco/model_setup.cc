#include "oted/sim/mujoco/model_setup.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "oted/base/error.h"
#include "oted/base/fields.h"
#include "oted/sim/mujoco/force_limits.h"
#include "oted/sim/mujoco/model_probe.h"
#include "oted/sim/mujoco/model_rules.h"
#include "oted/sim/mujoco/mujoco_setup.h"
#include "oted/sim/mujoco/object_path.h"
#include "oted/sim/mujoco/observable_unit.h"
#include "oted/sim/mujoco/observables.h"
#include "oted/sim/mujoco/place.h"

namespace oted {
namespace {

constexpr int kMostSteps = 100'000;  // of the physics in a control period

/// mjMAXVAL: MuJoCo takes a state beyond it for unstable.
bool IsActionRange(double low, double high) { return -mjMAXVAL <= low && low < high && high <= mjMAXVAL; }

// Builds one setup; the members follow the keys of the file.
class Builder {
 public:
  Builder(const ModelTask& task, MujocoSetup& setup, ModelPlan& plan)
      : task_(task), setup_(setup), plan_(plan), model_(*setup.loaded.model), spec_(setup.spec) {}

  void Build(const Array2<double>& logged_starts) {
    spec_.task = plan_.task = task_.name;
    spec_.max_episode_steps = task_.max_episode_steps;
    spec_.has_reward = !task_.reward.empty();
    ControlPeriod();
    Observations();
    Actions();
    Start(logged_starts);
    Settable();
    Quantities();
  }

 private:
  // "task.observations 'sensor/imu' (model 'robot.xml')", the beginning of an error.
  std::string At(const char* key, const std::string& value) const {
    return fmt::format("task.{} '{}' (model '{}')", key, value, setup_.model_path.string());
  }

  void ControlPeriod() {
    const double step = model_.opt.timestep;
    const double periods = std::round(task_.control_period / step);
    if (task_.control_period <= 0) {
      throw UsageError(
          fmt::format("task.control_period is missing, or 0: the time between two actions [s], a multiple of the "
                      "time step {} s of model '{}'",
                      step, setup_.model_path.string()));
    }
    if (periods < 1 || std::abs(periods * step - task_.control_period) > 1e-6 * task_.control_period) {
      throw UsageError(
          fmt::format("task.control_period is {} s, wanted a multiple of the time step {} s of model '{}'; "
                      "the nearest is {:.10g} s",
                      task_.control_period, step, setup_.model_path.string(), std::max(1.0, periods) * step));
    }
    if (periods > kMostSteps) {
      throw UsageError(fmt::format(
          "task.control_period is {} s and the time step of model '{}' {} s: {:.3g} steps of the physics per "
          "action, wanted at most {}; make the time step longer",
          task_.control_period, setup_.model_path.string(), step, periods, kMostSteps));
    }
    setup_.frame_skip = spec_.physics_steps = static_cast<int>(periods);
    spec_.step_weight = StepWeight(model_);
    spec_.control_period_s = plan_.control_period = periods * step;
  }

  void Observations() {
    if (task_.observations.empty()) throw UsageError("task.observations is empty; name at least one, joint/*/qpos");
    std::set<std::string> seen;
    for (const std::string& path : task_.observations) {
      for (const Observable& o : ResolveObservable(model_, path, At("observations", path))) {
        if (!seen.insert(o.name).second) {
          throw UsageError(
              fmt::format("{}: '{}' is observed twice; narrow one of the paths", At("observations", path), o.name));
        }
        observed_.push_back(o);
        spec_.observation_names.push_back(o.name);
        spec_.observation_units.push_back(UnitOf(model_, o));
        plan_.observation.push_back(plan_.Add(o.array, o.index, o.stage));
      }
    }
    spec_.observation_shape = {static_cast<int>(observed_.size())};
  }

  void Actions() {
    if (model_.nactuator == 0) {
      throw UsageError(
          fmt::format("model '{}' has no actuators; add some, or task.motors = [\"joint/*\"] for a motor on "
                      "each joint",
                      setup_.model_path.string()));
    }
    if (task_.actions.empty()) throw UsageError("task.actions is empty; name at least one, actuator/*");
    const std::vector<double>& range = task_.action_range;
    if (!range.empty() && (range.size() != 2 || !IsActionRange(range[0], range[1]))) {
      throw UsageError(
          fmt::format("task.action_range is [{}], wanted [low, high] with low < high, both within +-{:.0e}",
                      fmt::join(range, ", "), mjMAXVAL));
    }
    const ObjectKind kind{"actuator", mjOBJ_ACTUATOR, static_cast<int>(model_.nactuator)};
    for (const std::string& path : task_.actions) {
      const std::string what = At("actions", path);
      if (!path.starts_with("actuator/")) throw UsageError(what + ": wanted actuator/NAME, with * for any text");
      for (const int id : MatchObjects(model_, kind, std::string_view(path).substr(9), what)) AddActuator(id, what);
    }
    spec_.act_dim = plan_.n_actions = static_cast<int>(setup_.controls.size());
  }

  void AddActuator(int id, const std::string& what) {
    const std::string name = "actuator/" + ObjectName(model_, mjOBJ_ACTUATOR, id);
    const int n = model_.actuator_ctrlnum[id];
    for (int k = 0; k < n; ++k) {
      const int control = model_.actuator_ctrladr[id] + k;
      if (std::find(setup_.controls.begin(), setup_.controls.end(), control) != setup_.controls.end()) {
        throw UsageError(fmt::format("{}: '{}' is listed twice; narrow one of the paths", what, name));
      }
      double low = model_.actuator_ctrlrange[2 * control], high = model_.actuator_ctrlrange[2 * control + 1];
      if (!model_.actuator_ctrllimited[control]) {
        if (task_.action_range.empty()) {
          throw UsageError(
              fmt::format("{}: '{}' has no ctrlrange; give it one in the model, or set task.action_range = "
                          "[low, high]",
                          what, name));
        }
        low = task_.action_range[0];
        high = task_.action_range[1];
      }
      if (!IsActionRange(low, high)) {
        throw DataError(
            fmt::format("{}: the ctrlrange of '{}' is {} to {}, wanted two numbers within +-{:.0e}, the smaller "
                        "first; correct the model",
                        what, name, low, high, mjMAXVAL));
      }
      setup_.controls.push_back(control);
      spec_.action_names.push_back(n == 1 ? name : fmt::format("{}[{}]", name, k));
      spec_.action_low.push_back(low);
      spec_.action_high.push_back(high);
      spec_.bounds_action.push_back(model_.actuator_ctrllimited[control] != 0 ? 1 : 0);
    }
  }

  void Start(const Array2<double>& logged_starts) {
    plan_.start_noise = task_.start_noise;
    setup_.start_state = FixedState(model_);
    if (task_.start.starts_with("keyframe/")) {
      const ObjectKind kind{"keyframe", mjOBJ_KEY, static_cast<int>(model_.nkey)};
      const std::string what = At("start", task_.start);
      const std::vector<int> keys = MatchObjects(model_, kind, std::string_view(task_.start).substr(9), what);
      if (keys.size() > 1) throw UsageError(what + ": matches several keyframes; name one");
      setup_.start_state = FixedState(model_, keys[0]);
    } else if (task_.starts_in_logs()) {
      if (logged_starts.rows() == 0) {
        throw UsageError(
            "task.start = \"logs\" takes start states from logged data, and there are none here; name them as "
            "data.path, or set task.start to default or keyframe/NAME");
      }
      plan_.logged_starts = logged_starts;
    } else if (task_.start != "default") {
      throw UsageError(fmt::format("task.start is '{}', wanted default, keyframe/NAME or logs", task_.start));
    }
    if (task_.start_qpos.empty()) return;
    if (static_cast<int>(task_.start_qpos.size()) != model_.nq) {
      throw UsageError(fmt::format("task.start_qpos has {} numbers, wanted {}, one for each of {} (model '{}')",
                                   task_.start_qpos.size(), model_.nq, JointList(), setup_.model_path.string()));
    }
    std::vector<double> qpos = task_.start_qpos;
    mj_normalizeQuat(&model_, qpos.data());
    DataPtr data(mj_makeData(&model_));
    mj_setState(&model_, data.get(), setup_.start_state.data(), mjSTATE_INTEGRATION);
    std::copy(qpos.begin(), qpos.end(), data->qpos);
    mj_getState(&model_, data.get(), setup_.start_state.data(), mjSTATE_INTEGRATION);
  }

  std::string JointList() const {
    std::vector<std::string> names;
    for (const Observable& o : ResolveObservable(model_, "joint/*/qpos", "")) names.push_back(o.name);
    return fmt::format("{}", fmt::join(names, ", "));
  }

  // Every coordinate of the state is seen, or declared to be of no consequence.
  void Settable() {
    std::set<std::pair<StatePart, int>> known;
    for (const Observable& observed : observed_) {
      const Observable o = AsState(model_, observed);
      plan_.targets.push_back({o.part, static_cast<size_t>(o.index)});
      if (o.part != StatePart::kNone) known.insert({o.part, o.index});
    }
    setup_.driven = DrivenActivations(model_, setup_.controls, [&](int act) {
      return known.contains({StatePart::kAct, act});
    });
    plan_.followers = FollowersOf(model_, [&](int qpos) { return known.contains({StatePart::kQpos, qpos}); });
    const auto follows = [&](const Observable& o) {
      return std::ranges::any_of(plan_.followers, [&](const Follower& f) { return f.Sets(o.part, o.index); });
    };
    for (const std::string& path : task_.unobserved) {
      const std::string what = At("unobserved", path);
      for (const Observable& o : ResolveObservable(model_, path, what)) {
        if (o.part == StatePart::kNone) {
          throw UsageError(what +
                           ": wanted a coordinate of the state: joint/NAME/qpos, joint/NAME/qvel or "
                           "actuator/NAME/act");
        }
        if (!known.insert({o.part, o.index}).second && !follows(o)) {
          throw UsageError(fmt::format("{}: '{}' is observed, or listed twice; remove it here", what, o.name));
        }
      }
    }
    for (const DrivenActivation& driven : setup_.driven) known.insert({StatePart::kAct, driven.act});
    std::vector<Observable> missing;
    for (const char* all : {"joint/*/qpos", "joint/*/qvel", "actuator/*/act"}) {
      if (all[0] == 'j' ? model_.njnt == 0 : model_.na == 0) continue;
      for (const Observable& o : ResolveObservable(model_, all, "")) {
        if (known.contains({o.part, o.index}) || follows(o) || IsUnseenPlace(o)) continue;
        missing.push_back(o);
      }
    }
    Rates();
    if (mj_stateSize(&model_, mjSTATE_HISTORY) > 0) {
      setup_.why_not_settable = "the model delays actuators or sensors, and no observation shows what is on its way";
    } else if (!missing.empty()) {
      const size_t n_shown = std::min<size_t>(missing.size(), 4);
      std::vector<std::string> shown;
      for (size_t i = 0; i < n_shown; ++i) shown.push_back(missing[i].name);
      setup_.why_not_settable =
          fmt::format("no observation shows {}{}; observe them, or list those that change nothing in task.unobserved",
                      fmt::join(shown, ", "),
                      missing.size() > n_shown ? fmt::format(" and {} more", missing.size() - n_shown) : "");
      // Where positions are unknown, a fit has nothing to begin from.
      if (std::ranges::none_of(missing, [](const Observable& o) { return o.part == StatePart::kQpos; })) {
        for (const Observable& o : missing) AddHidden(o);
      }
    }
    spec_.can_set_state = setup_.why_not_settable.empty();
    // What no observation shows begins as in the start state: at rest.
    if (plan_.logged_starts.rows() > 0 && !spec_.can_set_state && spec_.hidden.empty()) {
      throw UsageError(fmt::format("task.start = \"logs\": {}", setup_.why_not_settable));
    }
    Quaternions();
  }

  // Where a robot stands need not be seen if nothing that is seen depends on it. Observations of other numbers may.
  bool IsUnseenPlace(const Observable& o) const {
    return o.part == StatePart::kQpos && IsPlace(model_, o.index) &&
           std::ranges::none_of(plan_.targets, [](const ModelPlan::Target& t) { return t.part == StatePart::kNone; });
  }

  // The observation that shows an entry of qpos, or of another part of the state, or -1.
  int SeenAt(int index, StatePart part = StatePart::kQpos) const {
    const auto found = std::find_if(plan_.targets.begin(), plan_.targets.end(), [&](const ModelPlan::Target& t) {
      return t.part == part && t.index == static_cast<size_t>(index);
    });
    return found == plan_.targets.end() ? -1 : static_cast<int>(found - plan_.targets.begin());
  }

  // The observation whose rate of change an entry of qvel is, or -1: one that turns a body in space is of none.
  int PositionOf(int qvel) const {
    const int joint = model_.dof_jntid[qvel], k = qvel - model_.jnt_dofadr[joint], type = model_.jnt_type[joint];
    const bool has_one = type == mjJNT_SLIDE || type == mjJNT_HINGE || (type == mjJNT_FREE && k < 3);
    return has_one ? SeenAt(model_.jnt_qposadr[joint] + k) : -1;
  }

  void Rates() {
    for (const ModelPlan::Target& t : plan_.targets) {
      spec_.rate_of.push_back(t.part == StatePart::kQvel ? PositionOf(static_cast<int>(t.index)) : -1);
    }
  }

  void AddHidden(const Observable& o) {
    HiddenCoordinate hidden{.name = o.name};
    if (o.part == StatePart::kQvel) {
      const int joint = model_.dof_jntid[o.index], k = o.index - model_.jnt_dofadr[joint];
      hidden.rate_of = PositionOf(o.index);
      const int first = model_.jnt_type[joint] == mjJNT_FREE ? 3 : 0;
      if ((model_.jnt_type[joint] == mjJNT_FREE && k >= 3) || model_.jnt_type[joint] == mjJNT_BALL) {
        bool seen = true;
        for (int i = 0; i < 4; ++i) {
          const int at = SeenAt(model_.jnt_qposadr[joint] + first + i);
          hidden.orientation[static_cast<size_t>(i)] = at;
          seen = seen && at >= 0;
        }
        hidden.turn_about = seen ? k - first : -1;
      }
    }
    spec_.hidden.push_back(hidden);
    plan_.hidden.push_back({o.part, static_cast<size_t>(o.index)});
  }

  // Those that an observation shows as a whole.
  void Quaternions() {
    for (int joint = 0; joint < model_.njnt; ++joint) {
      const int type = model_.jnt_type[joint];
      if (type != mjJNT_FREE && type != mjJNT_BALL) continue;
      const int first = model_.jnt_qposadr[joint] + (type == mjJNT_FREE ? 3 : 0);
      const std::array<int, 4> at = {SeenAt(first), SeenAt(first + 1), SeenAt(first + 2), SeenAt(first + 3)};
      if (std::none_of(at.begin(), at.end(), [](int i) { return i < 0; })) plan_.quaternions.push_back(at);
      spec_.bodies.push_back(BodyOf(joint, at));
    }
  }

  TurningBody BodyOf(int joint, const std::array<int, 4>& orientation) const {
    TurningBody body{.orientation = orientation};
    const bool is_free = model_.jnt_type[joint] == mjJNT_FREE;
    const int turn = model_.jnt_dofadr[joint] + (is_free ? 3 : 0);
    for (int k = 0; k < 3; ++k) {
      body.turn[static_cast<size_t>(k)] = SeenAt(turn + k, StatePart::kQvel);
      if (!is_free) continue;
      body.position[static_cast<size_t>(k)] = SeenAt(model_.jnt_qposadr[joint] + k);
      body.velocity[static_cast<size_t>(k)] = SeenAt(model_.jnt_dofadr[joint] + k, StatePart::kQvel);
    }
    return body;
  }

  void Quantities() {
    plan_.reward = task_.reward;
    plan_.terminate = task_.terminate;
    for (const auto& [name, path] : task_.quantities) {
      const auto plain = [](unsigned char c) { return std::isalnum(c) || c == '_'; };
      if (name.empty() || !std::all_of(name.begin(), name.end(), plain) ||
          std::isdigit(static_cast<unsigned char>(name[0]))) {
        throw UsageError(
            fmt::format("task.quantities: '{}' is no name; use letters, digits and '_', a letter first", name));
      }
      ModelPlan::Quantity quantity{.name = name, .elements = {}};
      for (const Observable& o : ResolveObservable(model_, path, At(("quantities." + name).c_str(), path))) {
        quantity.elements.push_back(plan_.Add(o.array, o.index, o.stage));
      }
      plan_.quantities.push_back(std::move(quantity));
    }
  }

  const ModelTask& task_;
  MujocoSetup& setup_;
  ModelPlan& plan_;
  const mjModel& model_;
  SimulatorSpec& spec_;
  std::vector<Observable> observed_;
};

}  // namespace

std::shared_ptr<const MujocoSetup> MakeModelSetup(const ModelTask& task, std::vector<ParameterSpec> specs,
                                                  const Array2<double>& logged_starts) {
  for (const ParameterSpec& spec : specs) spec.Check();
  auto setup = std::make_shared<MujocoSetup>();
  auto plan = std::make_shared<ModelPlan>();
  setup->model_path = FindModelFile(task.model);
  ProbeModel(setup->model_path);
  setup->loaded = LoadModelWithMotors(setup->model_path, task.motors, task.action_range);
  LetForcesBeLimited(specs, setup->loaded);
  LetInertiaMove(specs, setup->loaded);
  plan->model = setup->loaded.model.get();
  Builder(task, *setup, *plan).Build(logged_starts);
  AddParameters(std::move(specs), *setup);
  setup->spec.n_rows_before =
      StepsToForget(*plan->model, setup->driven, setup->fields, setup->space.specs(), setup->spec.control_period_s);
  if (plan->logged_starts.rows() > 0) {
    Array2<double> usable;
    const ModelRules rules(plan);
    for (int i = 0; i < logged_starts.rows(); ++i) {
      const auto row = logged_starts.row(i);
      if (static_cast<int>(row.size()) == setup->spec.obs_dim() && rules.Determines(row)) usable.AppendRow(row);
    }
    if (usable.rows() == 0) {
      throw DataError(
          fmt::format("task.start = \"logs\": no logged episode begins with {} numbers that determine a "
                      "state of task '{}'; check the data against task.observations",
                      setup->spec.obs_dim(), task.name));
    }
    plan->logged_starts = std::move(usable);
  }
  setup->make_rules = [plan = std::shared_ptr<const ModelPlan>(std::move(plan))] {
    return std::make_unique<ModelRules>(plan);
  };
  return setup;
}

}  // namespace oted
