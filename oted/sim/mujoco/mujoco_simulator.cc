#include "oted/sim/mujoco/mujoco_simulator.h"

#include <fmt/format.h>
#include <mujoco/mjbatch.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "oted/base/error.h"
#include "oted/sim/mujoco/mujoco_setup.h"

namespace oted {
namespace {

bool AllFinite(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

bool IsHealthy(const MujocoTask& task, std::span<const double> qpos, std::span<const double> qvel) {
  if (!task.healthy_height.Contains(qpos[1]) || !task.healthy_angle.Contains(qpos[2])) return false;
  const auto contained = [&](double v) { return task.healthy_remainder.Contains(v); };
  return std::all_of(qpos.begin() + 2, qpos.end(), contained) && std::all_of(qvel.begin(), qvel.end(), contained);
}

}  // namespace

void MujocoSimulator::BatchDeleter::operator()(mjBatch_* batch) const { mjb_deleteBatch(batch); }

MujocoSimulator::MujocoSimulator(std::shared_ptr<const MujocoSetup> setup, int n_lanes, int n_threads)
    : setup_(std::move(setup)) {
  if (n_lanes < 1 || n_threads < 1) {
    throw UsageError(fmt::format("got {} lanes and {} threads, wanted at least 1 of each", n_lanes, n_threads));
  }
  mjBatchConfig config;
  mjb_defaultConfig(&config);
  config.nthread = std::min(n_threads, n_lanes);
  std::array<char, 1000> reason{};
  batch_.reset(
      mjb_makeBatch(setup_->loaded.model.get(), n_lanes, &config, reason.data(), static_cast<int>(reason.size())));
  if (batch_ == nullptr) {
    throw DataError(fmt::format("MuJoCo cannot make {} simulations of '{}': {}", n_lanes, setup_->model_path.string(),
                                reason.data()));
  }
  n_state_ = mjb_nstate(batch_.get());
  state_ = {mjb_state(batch_.get()), n_state_};
  qpos_ = StateComponent(mjSTATE_QPOS);
  qvel_ = StateComponent(mjSTATE_QVEL);
  ctrl_ = StateComponent(mjSTATE_CTRL);
  for (const ModelField& field : setup_->fields) {
    fields_.push_back(Expand(field.array));
    if (field.array == "geom_size") bounding_radii_ = Expand("geom_rbound");
    changes_constants_ = changes_constants_ || field.changes_constants;
  }
  observations_ = Array2<double>(n_lanes, setup_->spec.obs_dim());
  lanes_.resize(static_cast<size_t>(n_lanes));
  active_.reserve(static_cast<size_t>(n_lanes));
  for (int lane = 0; lane < n_lanes; ++lane) SetIntegrationState(lane, setup_->default_state);
}

MujocoSimulator::~MujocoSimulator() = default;

const SimulatorSpec& MujocoSimulator::spec() const { return setup_->spec; }
const ParameterSpace& MujocoSimulator::parameters() const { return setup_->space; }

MujocoSimulator::Component MujocoSimulator::StateComponent(int component) {
  Component found;
  found.first = mjb_stateComponent(batch_.get(), component, &found.size);
  OTED_CHECK(found.first != nullptr);
  return found;
}

MujocoSimulator::ExpandedField MujocoSimulator::Expand(const std::string& array) {
  ExpandedField expanded;
  int element_size = 0;
  expanded.values = static_cast<double*>(mjb_expand(batch_.get(), array.c_str(), &expanded.size, &element_size));
  OTED_CHECK(expanded.values != nullptr && element_size == static_cast<int>(sizeof(double)));
  return expanded;
}

std::span<double> MujocoSimulator::Row(const Component& component, int lane) const {
  return {component.first + static_cast<ptrdiff_t>(lane) * n_state_, static_cast<size_t>(component.size)};
}

std::span<const double> MujocoSimulator::qpos(int lane) const { return Row(qpos_, lane); }
std::span<const double> MujocoSimulator::qvel(int lane) const { return Row(qvel_, lane); }
std::span<const double> MujocoSimulator::IntegrationState(int lane) const { return Row(state_, lane); }

void MujocoSimulator::SetParameters(int lane, std::span<const double> z) {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  setup_->space.CheckInside(z);
  for (size_t i = 0; i < fields_.size(); ++i) {
    const ModelField& field = setup_->fields[i];
    const bool multiple = setup_->space.specs()[i].scale == ParameterScale::kNominal;
    double* values = fields_[i].values + static_cast<ptrdiff_t>(lane) * fields_[i].size;
    for (size_t k = 0; k < field.indices.size(); ++k) {
      values[field.indices[k]] = multiple ? field.nominal[k] * z[i] : z[i];
    }
    if (field.array == "geom_size") UpdateBoundingRadii(lane, values);
  }
  // It reads the fields written above and nothing that an earlier call computed, so that twice is the same as once.
  if (changes_constants_ && mjb_setConst(batch_.get(), &lane, 1) != 0) {
    throw DataError(fmt::format("MuJoCo rejects these parameters: {}", mjb_error(batch_.get(), lane)));
  }
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
  lanes_[static_cast<size_t>(lane)] = Lane{};
  mjWarningStat* warnings = mjb_warning(batch_.get()) + static_cast<ptrdiff_t>(lane) * mjNWARNING;
  std::fill_n(warnings, static_cast<int>(mjNWARNING), mjWarningStat{});
  Observe(lane);
}

void MujocoSimulator::SetIntegrationState(int lane, std::span<const double> state) {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  if (static_cast<int>(state.size()) != n_state_) {
    throw UsageError(fmt::format("got a state of {} numbers, wanted {}", state.size(), n_state_));
  }
  std::copy(state.begin(), state.end(), Row(state_, lane).begin());
  StartEpisode(lane);
}

void MujocoSimulator::Reset(int lane, Rng& rng) {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  // Gymnasium calls mj_forward here; that changes no number of the state (the warm start is stored by mj_step alone).
  std::copy(setup_->default_state.begin(), setup_->default_state.end(), Row(state_, lane).begin());
  const double scale = setup_->task.reset_noise_scale;
  const bool normal = setup_->task.reset_noise == ResetNoise::kUniformPositionsNormal;
  for (double& q : Row(qpos_, lane)) q += rng.Uniform(-scale, scale);
  for (double& v : Row(qvel_, lane)) v += normal ? scale * rng.Normal() : rng.Uniform(-scale, scale);
  StartEpisode(lane);
}

bool MujocoSimulator::SetStateFromObservation(int lane, std::span<const double> observation) {
  OTED_CHECK(lane >= 0 && lane < n_lanes());
  if (static_cast<int>(observation.size()) != setup_->spec.obs_dim()) {
    throw UsageError(fmt::format("got an observation of {} numbers, wanted {} for {}", observation.size(),
                                 setup_->spec.obs_dim(), setup_->task.name));
  }
  const std::span<const double> positions = observation.first(static_cast<size_t>(qpos_.size - 1));
  const std::span<const double> velocities = observation.last(static_cast<size_t>(qvel_.size));
  const double clip = setup_->task.velocity_clip;
  const auto determined = [&](double v) { return std::isfinite(v) && std::abs(v) < clip; };
  if (!AllFinite(positions) || !std::all_of(velocities.begin(), velocities.end(), determined)) return false;
  std::copy(setup_->default_state.begin(), setup_->default_state.end(), Row(state_, lane).begin());
  Row(qpos_, lane)[0] = 0;
  std::copy(positions.begin(), positions.end(), Row(qpos_, lane).begin() + 1);
  std::copy(velocities.begin(), velocities.end(), Row(qvel_, lane).begin());
  StartEpisode(lane);
  return true;
}

std::optional<bool> MujocoSimulator::EndsAt(int lane, std::span<const double> observation) {
  if (!SetStateFromObservation(lane, observation)) return std::nullopt;
  return setup_->task.terminates && !IsHealthy(setup_->task, qpos(lane), qvel(lane));
}

void MujocoSimulator::Step(std::span<const int> lanes, std::span<const double> actions) {
  const size_t act_dim = static_cast<size_t>(ctrl_.size);
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
    Lane& l = lanes_[static_cast<size_t>(lane)];
    if (l.status == LaneStatus::kDiverged) continue;
    std::copy_n(actions.begin() + static_cast<ptrdiff_t>(lane) * ctrl_.size, ctrl_.size, Row(ctrl_, lane).begin());
    l.x_before = qpos(lane)[0];
    active_.push_back(lane);
  }
  if (active_.empty()) return;
  const int n_active = static_cast<int>(active_.size());
  if (mjb_step(batch_.get(), active_.data(), n_active, setup_->task.frame_skip, mjSTAGE_NONE) != 0) {
    for (int lane : active_) {
      if (mjb_status(batch_.get())[lane] != 0) {
        throw DataError(
            fmt::format("MuJoCo failed in lane {} of {}: {}", lane, setup_->task.name, mjb_error(batch_.get(), lane)));
      }
    }
  }
  for (int lane : active_) FinishStep(lane, actions.subspan(static_cast<size_t>(lane) * act_dim, act_dim));
}

// The order of the floating-point operations is Gymnasium's.
void MujocoSimulator::FinishStep(int lane, std::span<const double> action) {
  const MujocoTask& task = setup_->task;
  Lane& l = lanes_[static_cast<size_t>(lane)];
  ++l.episode_steps;
  if (TakeDivergence(lane)) {
    l.reward = 0;
    l.status = LaneStatus::kDiverged;
    return;
  }
  const bool healthy = !task.terminates || IsHealthy(task, qpos(lane), qvel(lane));
  const double x_velocity = (qpos(lane)[0] - l.x_before) / setup_->control_period;
  double sum_of_squares = 0;
  for (double a : action) sum_of_squares += a * a;
  const double control_cost = task.control_cost_weight * sum_of_squares;
  const double healthy_reward = healthy || task.healthy_on_terminal ? task.healthy_reward : 0.0;
  l.reward = task.forward_weight * x_velocity + healthy_reward - control_cost;
  l.status = !healthy                                    ? LaneStatus::kTerminated
             : l.episode_steps >= task.max_episode_steps ? LaneStatus::kTruncated
                                                         : LaneStatus::kRunning;
  Observe(lane);
}

void MujocoSimulator::Observe(int lane) {
  const std::span<double> out = observations_.row(lane);
  const std::span<const double> positions = qpos(lane).subspan(1);
  const double clip = setup_->task.velocity_clip;
  const auto next = std::copy(positions.begin(), positions.end(), out.begin());
  std::transform(qvel(lane).begin(), qvel(lane).end(), next, [&](double v) { return std::clamp(v, -clip, clip); });
}

// Whether the last control period broke down. MuJoCo counts it as a warning, with status 0: read it and clear it.
bool MujocoSimulator::TakeDivergence(int lane) {
  mjWarningStat* warnings = mjb_warning(batch_.get()) + static_cast<ptrdiff_t>(lane) * mjNWARNING;
  const bool warned =
      warnings[mjWARN_BADQPOS].number > 0 || warnings[mjWARN_BADQVEL].number > 0 || warnings[mjWARN_BADQACC].number > 0;
  std::fill_n(warnings, static_cast<int>(mjNWARNING), mjWarningStat{});
  return warned || !AllFinite(Row(state_, lane));
}

MujocoSimulatorFactory::MujocoSimulatorFactory(const std::string& task, std::vector<ParameterSpec> specs)
    : setup_(MakeMujocoSetup(task, std::move(specs))) {}
MujocoSimulatorFactory::~MujocoSimulatorFactory() = default;

const SimulatorSpec& MujocoSimulatorFactory::spec() const { return setup_->spec; }
const ParameterSpace& MujocoSimulatorFactory::parameters() const { return setup_->space; }
const MujocoTask& MujocoSimulatorFactory::task() const { return setup_->task; }
std::string MujocoSimulatorFactory::model_path() const { return setup_->model_path.string(); }
std::string MujocoSimulatorFactory::model_sha256() const { return setup_->loaded.sha256; }

std::unique_ptr<Simulator> MujocoSimulatorFactory::Make(int n_lanes, int n_threads) const {
  return MakeMujoco(n_lanes, n_threads);
}

std::unique_ptr<MujocoSimulator> MujocoSimulatorFactory::MakeMujoco(int n_lanes, int n_threads) const {
  return std::make_unique<MujocoSimulator>(setup_, n_lanes, n_threads);
}

}  // namespace oted
