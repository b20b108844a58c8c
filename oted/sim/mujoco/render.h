#pragma once
/// Pictures of a simulator's poses, drawn off-screen by MuJoCo.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "oted/sim/mujoco/mujoco_simulator.h"

namespace oted {

/// Not thread-safe; to be used on the thread that made it.
class Renderer {
 public:
  /// @param width, height  of the pictures [pixels], multiples of 4
  /// @return null where there is no OpenGL context, or MuJoCo cannot use it; `why_not` says why in one line
  static std::unique_ptr<Renderer> Make(const MujocoSimulatorFactory& factory, int width, int height,
                                        std::string* why_not);
  ~Renderer();

  /// The model with parameters `z` in pose `qpos` (nq), seen by the model's first camera that follows the robot, or,
  /// where it has none, by one that shows the whole model and follows a base that moves.
  /// @return (height, width, 3) bytes, red green blue, the top row first; valid until the next call
  /// @throws DataError when MuJoCo cannot draw it.
  const std::vector<uint8_t>& Draw(std::span<const double> z, std::span<const double> qpos);

  int width() const;
  int height() const;
  const std::string& description() const;  ///< what draws: "EGL, llvmpipe (...)"

 private:
  struct Scene;
  explicit Renderer(std::unique_ptr<Scene> scene);
  std::unique_ptr<Scene> scene_;
};

/// The picture as a WebP file, lossy.
/// @param rgb  (height, width, 3); both sides at most 16383
std::string EncodeWebp(std::span<const uint8_t> rgb, int width, int height, double quality);

}  // namespace oted
