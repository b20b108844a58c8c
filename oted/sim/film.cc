#include "oted/sim/film.h"

#include <webp/encode.h>

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

// Number k of the pose is the same in all determined rows, though its velocity is not zero.
bool IsUnseen(const Array2<double>& poses, const Array2<double>& rates, int k) {
  double first = std::numeric_limits<double>::quiet_NaN();
  bool moves = false;
  for (int t = 0; t < poses.rows(); ++t) {
    moves = moves || rates(t, k) != 0;
    const double value = poses(t, k);
    if (std::isnan(value)) continue;
    if (std::isnan(first)) first = value;
    if (value != first) return false;
  }
  return moves;
}

/// Into the state that an observation shows; what no observation shows of it is 0.
bool Show(Simulator& simulator, std::span<const double> observation) {
  if (simulator.spec().can_set_state) return simulator.SetStateFromObservation(0, observation);
  std::vector<double> state(observation.begin(), observation.end());
  state.resize(static_cast<size_t>(simulator.spec().state_dim()));
  return simulator.SetState(0, state, {});
}

/// The picture (height, width, 3) as a WebP file, lossy; both sides at most 16383.
std::string EncodeWebp(std::span<const uint8_t> rgb, int width, int height, double quality) {
  OTED_CHECK(rgb.size() == 3 * static_cast<size_t>(width) * static_cast<size_t>(height));
  uint8_t* bytes = nullptr;
  const size_t size = WebPEncodeRGB(rgb.data(), width, height, 3 * width, static_cast<float>(quality), &bytes);
  OTED_CHECK(size > 0);
  const std::string file(reinterpret_cast<const char*>(bytes), size);
  WebPFree(bytes);
  return file;
}

}  // namespace

FilmStrip DrawFilm(Renderer& renderer, const PoseTrack& track) {
  const size_t width = static_cast<size_t>(renderer.width()), height = static_cast<size_t>(renderer.height());
  const size_t n = static_cast<size_t>(track.poses.rows());
  OTED_CHECK(n > 0);
  const size_t columns = std::min<size_t>(kColumns, n), rows = (n + columns - 1) / columns;
  std::vector<uint8_t> strip(3 * columns * width * rows * height);
  std::vector<double> pose(track.poses.row(0).begin(), track.poses.row(0).end());
  OTED_CHECK(AllFinite(pose));
  for (size_t t = 0; t < n; ++t) {
    const auto row = track.poses.row(static_cast<int>(t));
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

Array2<double> PosesOfObservations(Simulator& simulator, const Array2<double>& observations) {
  const int n = observations.rows(), n_numbers = static_cast<int>(simulator.pose(0).size());
  Array2<double> poses(n, n_numbers, std::numeric_limits<double>::quiet_NaN());
  Array2<double> rates(n, n_numbers, 0.0);
  for (int t = 0; t < n; ++t) {
    if (!Show(simulator, observations.row(t))) continue;
    std::copy(simulator.pose(0).begin(), simulator.pose(0).end(), poses.row(t).begin());
    const std::vector<double> rate = simulator.pose_rates(0);
    std::copy(rate.begin(), rate.end(), rates.row(t).begin());
  }
  const double dt = simulator.spec().control_period_s;
  for (int k = 0; k < n_numbers; ++k) {
    if (!IsUnseen(poses, rates, k)) continue;
    double position = 0;
    for (int t = 0; t < n; ++t) {
      if (t > 0) position += dt * (rates(t - 1, k) + rates(t, k)) / 2;
      if (!std::isnan(poses(t, k))) poses(t, k) += position;
    }
  }
  return poses;
}

}  // namespace oted
