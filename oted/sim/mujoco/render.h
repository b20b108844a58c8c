#pragma once
/// MuJoCo's renderer, off-screen.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "oted/sim/mujoco/mujoco_simulator_factory.h"

namespace oted {

/// Not thread-safe; to be used on the thread that made it.
class MujocoRenderer : public Renderer {
 public:
  /// @param width, height  of the pictures [pixels], multiples of 4
  /// @return null where there is no OpenGL context, or MuJoCo cannot use it; `why_not` says why in one line
  static std::unique_ptr<MujocoRenderer> Make(const MujocoSimulatorFactory& factory, int width, int height,
                                              std::string* why_not);
  ~MujocoRenderer() override;

  /// The model with parameters `z` in pose `qpos` (nq), seen by the model's first camera that follows the robot, or,
  /// where it has none, by one that shows the whole model and follows a base that moves. Without a sky the background
  /// is light grey; without lights the one at the camera is brighter than MuJoCo's.
  /// @return (height, width, 3) bytes, red green blue, the top row first; valid until the next call
  /// @throws DataError when MuJoCo cannot draw it.
  const std::vector<uint8_t>& Draw(std::span<const double> z, std::span<const double> qpos) override;

  int width() const override;
  int height() const override;
  const std::string& description() const override;

 private:
  struct Scene;
  explicit MujocoRenderer(std::unique_ptr<Scene> scene);
  std::unique_ptr<Scene> scene_;
};

}  // namespace oted
