#include "oted/sim/mujoco/mujoco_simulator.h"

#include <fmt/format.h>
#include <mujoco/mjbatch.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "oted/base/error.h"
#include "oted/sim/mujoco/joint_friction.h"
#include "oted/sim/mujoco/joint_residual.h"
#include "oted/sim/mujoco/mujoco_setup.h"

namespace oted {
namespace {

bool AllFinite(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

}  // namespace

bool MujocoSimulator::BatchDeleter::HasLostThreads() const { return threads_of != 0 && threads_of != ::getpid(); }

void MujocoSimulator::BatchDeleter::operator()(mjBatch_* batch) const {
  // MuJoCo would wait for them.
  if (!HasLostThreads()) mjb_deleteBatch(batch);
}

MujocoSimulator::MujocoSimulator(std::shared_ptr<const MujocoSetup> setup, int n_lanes, int n_threads)
    : setup_(std::move(setup)) {
  if (n_lanes < 1 || n_threads < 1) {
    throw UsageError(fmt::format("got {} lanes and {} threads, wanted at least 1 of each", n_lanes, n_threads));
  }
  mjBatchConfig config;
  mjb_defaultConfig(&config);
  config.nthread = std::min(n_threads, n_lanes);
  std::array<char, 1000> reason{};
  batch_ = {mjb_makeBatch(setup_->loaded.model.get(), n_lanes, &config, reason.data(), static_cast<int>(reason.size())),
            BatchDeleter{config.nthread > 1 ? ::getpid() : 0}};
  if (batch_ == nullptr) {
    throw DataError(
        fmt::format("MuJoCo cannot make {} simulations of '{}': {}; take fewer at once, or a machine with "
                    "more memory",
                    n_lanes, setup_->model_path.string(), reason.data()));
  }
  n_state_ = mjb_nstate(batch_.get());
  state_ = {mjb_state(batch_.get()), n_state_, n_state_};
  qpos_ = StateComponent(mjSTATE_QPOS);
  qvel_ = StateComponent(mjSTATE_QVEL);
  ctrl_ = StateComponent(mjSTATE_CTRL);
  if (setup_->loaded.model->na > 0) act_ = StateComponent(mjSTATE_ACT);
  rules_ = setup_->make_rules();
  for (const std::string& name : rules_->arrays()) arrays_.push_back(ArrayNamed(name));
  const auto is_searched = [&](const auto& is_it) {
    return std::ranges::any_of(setup_->fields, [&](const ModelField& field) { return is_it(field.array); });
  };
  if (is_searched(IsFrictionArray)) {
    const bool loaded = is_searched([](const auto& array) { return array == kFrictionArrays[kLoadFriction].name; });
    friction_ = std::make_unique<JointFriction>(batch_.get(), loaded);
  }
  if (is_searched([](const auto& array) { return array == kResidualArray; })) {
    residual_ = std::make_unique<JointResidual>(batch_.get());
  }
  for (const ModelField& field : setup_->fields) {
    fields_.push_back(Expand(field.array));
    unit_vectors_.Add(field, fields_.back().values, fields_.back().size);
    if (field.array == "geom_size") bounding_radii_ = Expand("geom_rbound");
    if (field.array == "actuator_dynprm") dynprm_ = fields_.back();
    changes_constants_ = changes_constants_ || field.changes_constants;
  }
  observations_ = Array2<double>(n_lanes, setup_->spec.obs_dim());
  observation_.resize(static_cast<size_t>(setup_->spec.obs_dim()));
  memory_ = Array2<double>(n_lanes, rules_->memory_size());
  lanes_.resize(static_cast<size_t>(n_lanes));
  parameters_.resize(lanes_.size());
  active_.reserve(static_cast<size_t>(n_lanes));
  for (int lane = 0; lane < n_lanes; ++lane) SetIntegrationState(lane, setup_->start_state);
}

MujocoSimulator::~MujocoSimulator() = default;

const SimulatorSpec& MujocoSimulator::spec() const { return setup_->spec; }
const ParameterSpace& MujocoSimulator::parameters() const { return setup_->space; }

LaneArray MujocoSimulator::StateComponent(int component) {
  LaneArray found;
  found.first = mjb_stateComponent(batch_.get(), component, &found.size);
  found.stride = n_state_;
  OTED_CHECK(found.first != nullptr);
  return found;
}

LaneArray MujocoSimulator::ArrayNamed(const std::string& name) {
  if (name == "qpos") return qpos_;
  if (name == "qvel") return qvel_;
  if (name == "act") return act_;
  LaneArray found;
  int element_size = 0;
  found.first = static_cast<double*>(mjb_output(batch_.get(), name.c_str(), &found.size, &element_size));
  found.stride = found.size;
  OTED_CHECK(found.first != nullptr && element_size == static_cast<int>(sizeof(double)));
  return found;
}

LaneState MujocoSimulator::StateOf(int lane) const {
  return {.qpos = qpos_.row(lane),
          .qvel = qvel_.row(lane),
          .act = act_.first == nullptr ? std::span<double>() : act_.row(lane)};
}

MujocoSimulator::ExpandedField MujocoSimulator::Expand(const std::string& array) {
  ExpandedField expanded;
  if (friction_ != nullptr && (IsFrictionArray(array) || array == "dof_frictionloss")) {
    return {.values = friction_->Values(array), .size = static_cast<int>(setup_->loaded.model->nv)};
  }
  if (array == kResidualArray) {
    return {.values = residual_->Weights(), .size = static_cast<int>(setup_->loaded.model->nv) * kResidualSize};
  }
  int element_size = 0;
  expanded.values = static_cast<double*>(mjb_expand(batch_.get(), array.c_str(), &expanded.size, &element_size));
  OTED_CHECK(expanded.values != nullptr && element_size == static_cast<int>(sizeof(double)));
  return expanded;
}

std::span<const double> MujocoSimulator::qpos(int lane) const { return qpos_.row(lane); }
std::span<const double> MujocoSimulator::qvel(int lane) const { return qvel_.row(lane); }
std::vector<double> MujocoSimulator::pose_rates(int lane) const {
  const mjModel& model = *setup_->loaded.model;
  std::vector<double> rates(static_cast<size_t>(model.nq), 0.0);
  for (int joint = 0; joint < model.njnt; ++joint) {
    if (model.jnt_type[joint] != mjJNT_SLIDE && model.jnt_type[joint] != mjJNT_HINGE) continue;
    rates[static_cast<size_t>(model.jnt_qposadr[joint])] = qvel(lane)[static_cast<size_t>(model.jnt_dofadr[joint])];
  }
  return rates;
}
std::span<const double> MujocoSimulator::IntegrationState(int lane) const { return state_.row(lane); }

void MujocoSimulator::CopyModel(int lane, mjModel_& model) const {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  mjb_getModel(batch_.get(), lane, &model);
  if (friction_ != nullptr) std::ranges::copy(friction_->Base(lane), model.dof_frictionloss);
}

void MujocoSimulator::SetParameters(int lane, std::span<const double> z) {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  setup_->space.CheckInside(z);
  // Fits set the same values again and again, and MuJoCo's constants take as long as a step.
  std::vector<double>& present = parameters_[static_cast<size_t>(lane)];
  if (!present.empty() && std::ranges::equal(present, z)) return;
  present.clear();
  const auto values_of = [&](size_t i) { return fields_[i].values + static_cast<ptrdiff_t>(lane) * fields_[i].size; };
  unit_vectors_.Reset(lane);
  for (size_t i = 0; i < fields_.size(); ++i) {
    const ModelField& field = setup_->fields[i];
    for (size_t k = 0; k < field.indices.size(); ++k) values_of(i)[field.indices[k]] = field.nominal[k];
  }
  for (size_t i = 0; i < fields_.size(); ++i) {
    const ModelField& field = setup_->fields[i];
    const double value = z[field.parameter];
    const bool multiple = setup_->space.specs()[field.parameter].IsMultiple();
    for (const int at : field.indices) {
      double& place = values_of(i)[at];
      place = multiple ? place * value : field.sign * value;
    }
    if (field.array == "geom_size") UpdateBoundingRadii(lane, values_of(i));
  }
  unit_vectors_.Normalize(lane);
  // It reads the fields written above and nothing that an earlier call computed, so that twice is the same as once.
  if (changes_constants_ && mjb_setConst(batch_.get(), &lane, 1) != 0) {
    throw DataError(fmt::format("MuJoCo rejects these parameters: {}", mjb_error(batch_.get(), lane)));
  }
  present.assign(z.begin(), z.end());
}

// Collision detection first asks whether bounding spheres touch: they must grow with the geoms.
void MujocoSimulator::UpdateBoundingRadii(int lane, const double* sizes) {
  const mjModel& model = *setup_->loaded.model;
  double* radii = bounding_radii_.values + static_cast<ptrdiff_t>(lane) * bounding_radii_.size;
  for (int geom = 0; geom < model.ngeom; ++geom) {
    radii[geom] = BoundingRadius(model.geom_type[geom], sizes + 3 * geom, model.geom_rbound[geom]);
  }
}

void MujocoSimulator::StartEpisode(int lane) {
  CheckThreads();
  lanes_[static_cast<size_t>(lane)] = Lane{};
  mjWarningStat* warnings = mjb_warning(batch_.get()) + static_cast<ptrdiff_t>(lane) * mjNWARNING;
  std::fill_n(warnings, static_cast<int>(mjNWARNING), mjWarningStat{});
  if (friction_ != nullptr) friction_->Rest(lane);
  if (residual_ != nullptr) residual_->Write(lane);
  // A state that is no state would be computed with; its next step reports it.
  if (rules_->stage() != mjSTAGE_NONE && AllFinite(state_.row(lane)) &&
      mjb_forward(batch_.get(), &lane, 1, rules_->stage()) != 0) {
    throw DataError(
        fmt::format("MuJoCo failed in lane {} of {}: {}", lane, setup_->spec.task, mjb_error(batch_.get(), lane)));
  }
  const LaneView view(arrays_, lane);
  rules_->Begin(view, memory_.row(lane));
  rules_->Observe(view, observations_.row(lane));
}

void MujocoSimulator::SetIntegrationState(int lane, std::span<const double> state) {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  if (static_cast<int>(state.size()) != n_state_) {
    throw UsageError(fmt::format("got a state of {} numbers, wanted {}", state.size(), n_state_));
  }
  std::copy(state.begin(), state.end(), state_.row(lane).begin());
  StartEpisode(lane);
}

void MujocoSimulator::Reset(int lane, Rng& rng) {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  std::copy(setup_->start_state.begin(), setup_->start_state.end(), state_.row(lane).begin());
  rules_->DrawStart(rng, StateOf(lane));
  StartEpisode(lane);
}

void MujocoSimulator::ResetTo(int lane, std::span<const double> qpos, std::span<const double> qvel, Rng&) {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  const LaneState state = StateOf(lane);
  if (qpos.size() != state.qpos.size() || qvel.size() != state.qvel.size() || !AllFinite(qpos) || !AllFinite(qvel)) {
    throw UsageError(fmt::format("got a start of {} positions and {} velocities, wanted {} and {} finite numbers",
                                 qpos.size(), qvel.size(), state.qpos.size(), state.qvel.size()));
  }
  std::copy(setup_->start_state.begin(), setup_->start_state.end(), state_.row(lane).begin());
  std::copy(qpos.begin(), qpos.end(), state.qpos.begin());
  std::copy(qvel.begin(), qvel.end(), state.qvel.begin());
  StartEpisode(lane);
}

bool MujocoSimulator::SetStateFromObservation(int lane, std::span<const double> observation) {
  return SetStateFromLog(lane, observation, {});
}

bool MujocoSimulator::SetStateFromLog(int lane, std::span<const double> observation, const LoggedHistory& before) {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  if (!setup_->spec.can_set_state) {
    throw UsageError(
        fmt::format("task '{}' cannot be set to an observed state: {}", setup_->spec.task, setup_->why_not_settable));
  }
  if (static_cast<int>(observation.size()) != setup_->spec.obs_dim()) {
    throw UsageError(fmt::format("got an observation of {} numbers, wanted {} for {}", observation.size(),
                                 setup_->spec.obs_dim(), setup_->spec.task));
  }
  return SetTo(lane, observation, {}, before);
}

bool MujocoSimulator::SetState(int lane, std::span<const double> state, const LoggedHistory& before) {
  const SimulatorSpec& spec = setup_->spec;
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  if (spec.hidden.empty()) return SetStateFromLog(lane, state, before);
  if (static_cast<int>(state.size()) != spec.state_dim()) {
    throw UsageError(fmt::format("got a state of {} numbers, wanted {} for {}: what is observed, then what is not",
                                 state.size(), spec.state_dim(), spec.task));
  }
  const size_t obs_dim = static_cast<size_t>(spec.obs_dim());
  return SetTo(lane, state.first(obs_dim), state.subspan(obs_dim), before);
}

bool MujocoSimulator::SetTo(int lane, std::span<const double> observation, std::span<const double> hidden,
                            const LoggedHistory& before) {
  if (!AllFinite(observation) || !AllFinite(hidden) || !rules_->Determines(observation)) return false;
  std::copy(setup_->start_state.begin(), setup_->start_state.end(), state_.row(lane).begin());
  FollowCommands(lane, before.actions);
  rules_->SetHidden(hidden, StateOf(lane));
  rules_->SetState(observation, StateOf(lane));
  StartEpisode(lane);
  // Sensors of forces and accelerations depend on controls that were never logged: what was seen is what is shown.
  std::copy(observation.begin(), observation.end(), observations_.row(lane).begin());
  return true;
}

void MujocoSimulator::FollowCommands(int lane, std::span<const double> actions) {
  const mjModel& model = *setup_->loaded.model;
  for (const DrivenActivation& driven : setup_->driven) {
    const double* dynprm = dynprm_.values == nullptr ? model.actuator_dynprm
                                                     : dynprm_.values + static_cast<ptrdiff_t>(lane) * dynprm_.size;
    double& act = act_.row(lane)[static_cast<size_t>(driven.act)];
    act = ActivationAfter(model, driven, dynprm[mjNDYN * driven.actuator], act,
                          {actions, setup_->spec.act_dim, setup_->frame_skip});
  }
}

std::optional<bool> MujocoSimulator::EndsAt(int lane, std::span<const double> observation) {
  if (!SetStateFromObservation(lane, observation)) return std::nullopt;
  return rules_->Ends(LaneView(arrays_, lane));
}

void MujocoSimulator::Activate(std::span<const int> lanes, std::span<const double> actions) {
  const size_t act_dim = setup_->controls.size();
  OTED_CHECK(actions.size() == lanes_.size() * act_dim);
  for (int lane : lanes) {
    OTED_CHECK(lane >= 0 && lane < n_lanes());
    if (!AllFinite(actions.subspan(static_cast<size_t>(lane) * act_dim, act_dim))) {
      throw UsageError(
          fmt::format("lane {}: got an action that is not finite, wanted {} finite numbers", lane, act_dim));
    }
  }
  active_.clear();
  for (int lane : lanes) {
    if (lanes_[static_cast<size_t>(lane)].status != LaneStatus::kDiverged) active_.push_back(lane);
  }
}

void MujocoSimulator::SetControls(int lane, std::span<const double> action) {
  for (size_t k = 0; k < action.size(); ++k) ctrl_.row(lane)[static_cast<size_t>(setup_->controls[k])] = action[k];
}

void MujocoSimulator::Step(std::span<const int> lanes, std::span<const double> actions) {
  Activate(lanes, actions);
  if (active_.empty()) return;
  const size_t act_dim = setup_->controls.size();
  const auto action = [&](int lane) { return actions.subspan(static_cast<size_t>(lane) * act_dim, act_dim); };
  for (const int lane : active_) SetControls(lane, action(lane));
  CheckPhysics(StepPhysics(setup_->frame_skip, true));
  for (const int lane : active_) FinishStep(lane, action(lane));
}

void MujocoSimulator::StepLate(std::span<const int> lanes, std::span<const double> actions, const LateActions& late) {
  OTED_CHECK(late.before.size() == actions.size() && late.share.size() == actions.size());
  Activate(lanes, actions);
  if (active_.empty()) return;
  const int n_steps = setup_->frame_skip;
  const size_t act_dim = setup_->controls.size();
  // When any control changes: before and after the step that its share ends in.
  std::vector<int> changes = {0, n_steps};
  for (const int lane : active_) {
    for (const double share : late.share.subspan(static_cast<size_t>(lane) * act_dim, act_dim)) {
      OTED_CHECK(share >= 0 && share < 1);
      const double end = share * n_steps;
      changes.push_back(static_cast<int>(std::floor(end)));
      changes.push_back(static_cast<int>(std::ceil(end)));
    }
  }
  std::ranges::sort(changes);
  changes.erase(std::ranges::unique(changes).begin(), changes.end());
  std::vector<double> held(act_dim);
  // Each at the action before for its share of the steps from `begin` to `end`.
  const auto hold = [&](int lane, double begin, double end) -> std::span<const double> {
    for (size_t k = 0; k < act_dim; ++k) {
      const size_t i = static_cast<size_t>(lane) * act_dim + k;
      const double share = std::clamp((late.share[i] * n_steps - begin) / (end - begin), 0.0, 1.0);
      held[k] = share == 0   ? actions[i]
                : share == 1 ? late.before[i]
                             : setup_->spec.MeanAction(k, late.before[i], actions[i], share);
    }
    return held;
  };
  for (size_t i = 0; i + 1 < changes.size(); ++i) {
    for (const int lane : active_) SetControls(lane, hold(lane, changes[i], changes[i + 1]));
    CheckPhysics(StepPhysics(changes[i + 1] - changes[i], changes[i + 1] == n_steps));
  }
  for (const int lane : active_) FinishStep(lane, hold(lane, 0, n_steps));
}

void MujocoSimulator::CheckPhysics(int n_failed) const {
  if (n_failed == 0) return;
  for (const int lane : active_) {
    if (mjb_status(batch_.get())[lane] != 0) {
      throw DataError(
          fmt::format("MuJoCo failed in lane {} of {}: {}", lane, setup_->spec.task, mjb_error(batch_.get(), lane)));
    }
  }
}

void MujocoSimulator::CheckThreads() const {
  if (!batch_.get_deleter().HasLostThreads()) return;
  throw UsageError(
      "a simulator with several threads does not survive a fork; make it in the child process, or with one thread");
}

int MujocoSimulator::StepPhysics(int n_steps, bool is_last) {
  CheckThreads();
  const int n = static_cast<int>(active_.size()), last_stage = is_last ? rules_->stage() : mjSTAGE_NONE;
  if (friction_ == nullptr && residual_ == nullptr) {
    return mjb_step(batch_.get(), active_.data(), n, n_steps, last_stage);
  }
  int n_failed = 0;
  for (int step = 0; step < n_steps && n_failed == 0; ++step) {
    if (residual_ != nullptr) {
      for (const int lane : active_) residual_->Write(lane);
    }
    if (friction_ != nullptr) n_failed = friction_->Prepare(active_);
    const int stage = step + 1 == n_steps ? last_stage : static_cast<int>(mjSTAGE_NONE);
    if (n_failed == 0) n_failed = mjb_step(batch_.get(), active_.data(), n, 1, stage);
  }
  return n_failed;
}

void MujocoSimulator::FinishStep(int lane, std::span<const double> action) {
  Lane& l = lanes_[static_cast<size_t>(lane)];
  ++l.episode_steps;
  const LaneView view(arrays_, lane);
  bool diverged = TakeDivergence(lane);
  if (!diverged) {
    rules_->Observe(view, observation_);
    diverged = !AllFinite(observation_);
  }
  if (diverged) {
    l.reward = 0;
    l.status = LaneStatus::kDiverged;
    return;
  }
  std::copy(observation_.begin(), observation_.end(), observations_.row(lane).begin());
  const double time = l.episode_steps * setup_->spec.control_period_s;
  const StepOutcome outcome = rules_->Finish(view, action, time, memory_.row(lane));
  l.reward = outcome.reward;
  l.status = outcome.terminated                                  ? LaneStatus::kTerminated
             : l.episode_steps >= setup_->spec.max_episode_steps ? LaneStatus::kTruncated
                                                                 : LaneStatus::kRunning;
}

// Whether the last control period broke down. MuJoCo counts it as a warning, with status 0: read it and clear it.
bool MujocoSimulator::TakeDivergence(int lane) {
  mjWarningStat* warnings = mjb_warning(batch_.get()) + static_cast<ptrdiff_t>(lane) * mjNWARNING;
  const bool warned =
      warnings[mjWARN_BADQPOS].number > 0 || warnings[mjWARN_BADQVEL].number > 0 || warnings[mjWARN_BADQACC].number > 0;
  std::fill_n(warnings, static_cast<int>(mjNWARNING), mjWarningStat{});
  return warned || !AllFinite(state_.row(lane));
}

}  // namespace oted
