#include "oted/sim/mujoco/film.h"

#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "oted/base/error.h"

namespace oted {
namespace {

constexpr int kColumns = 8;
constexpr double kQuality = 75;

bool AllFinite(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

// The position at `address` is the same in all determined rows, though the velocity is not zero.
bool IsUnseen(const Array2<double>& qpos, int address, const std::vector<double>& velocity) {
  double first = std::numeric_limits<double>::quiet_NaN();
  for (int t = 0; t < qpos.rows(); ++t) {
    const double value = qpos(t, address);
    if (std::isnan(value)) continue;
    if (std::isnan(first)) first = value;
    if (value != first) return false;
  }
  return std::any_of(velocity.begin(), velocity.end(), [](double v) { return v != 0; });
}

}  // namespace

FilmStrip DrawFilm(Renderer& renderer, const PoseTrack& track) {
  const size_t width = static_cast<size_t>(renderer.width()), height = static_cast<size_t>(renderer.height());
  const size_t n = static_cast<size_t>(track.qpos.rows());
  OTED_CHECK(n > 0);
  const size_t columns = std::min<size_t>(kColumns, n), rows = (n + columns - 1) / columns;
  std::vector<uint8_t> strip(3 * columns * width * rows * height);
  std::vector<double> pose(track.qpos.row(0).begin(), track.qpos.row(0).end());
  OTED_CHECK(AllFinite(pose));
  for (size_t t = 0; t < n; ++t) {
    const auto row = track.qpos.row(static_cast<int>(t));
    if (AllFinite(row)) std::copy(row.begin(), row.end(), pose.begin());
    const std::vector<uint8_t>& picture = renderer.Draw(track.z, pose);
    for (size_t y = 0; y < height; ++y) {
      const size_t at = ((t / columns * height + y) * columns + t % columns) * width;
      std::copy_n(picture.begin() + static_cast<ptrdiff_t>(3 * y * width), 3 * width,
                  strip.begin() + static_cast<ptrdiff_t>(3 * at));
    }
  }
  FilmStrip film;
  film.webp = EncodeWebp(strip, static_cast<int>(columns * width), static_cast<int>(rows * height), kQuality);
  film.columns = static_cast<int>(columns);
  film.n_frames = static_cast<int>(n);
  return film;
}

Array2<double> PosesOfObservations(MujocoSimulator& simulator, const Array2<double>& observations) {
  const mjModel& model = *mjb_model(simulator.batch());
  const int n = observations.rows();
  Array2<double> qpos(n, static_cast<int>(model.nq), std::numeric_limits<double>::quiet_NaN());
  Array2<double> qvel(n, static_cast<int>(model.nv), 0.0);
  for (int t = 0; t < n; ++t) {
    if (!simulator.SetStateFromObservation(0, observations.row(t))) continue;
    std::copy(simulator.qpos(0).begin(), simulator.qpos(0).end(), qpos.row(t).begin());
    std::copy(simulator.qvel(0).begin(), simulator.qvel(0).end(), qvel.row(t).begin());
  }
  const double dt = simulator.spec().control_period_s;
  for (int joint = 0; joint < model.njnt; ++joint) {
    if (model.jnt_type[joint] != mjJNT_SLIDE && model.jnt_type[joint] != mjJNT_HINGE) continue;
    const int address = model.jnt_qposadr[joint], dof = model.jnt_dofadr[joint];
    std::vector<double> velocity;
    for (int t = 0; t < n; ++t) velocity.push_back(qvel(t, dof));
    if (!IsUnseen(qpos, address, velocity)) continue;
    double position = 0;
    for (int t = 0; t < n; ++t) {
      if (t > 0) position += dt * (velocity[static_cast<size_t>(t - 1)] + velocity[static_cast<size_t>(t)]) / 2;
      if (!std::isnan(qpos(t, address))) qpos(t, address) += position;
    }
  }
  return qpos;
}

}  // namespace oted
