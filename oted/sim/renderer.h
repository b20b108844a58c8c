#pragma once
/// Pictures of a simulator's poses. SimulatorFactory::MakeRenderer makes one where it can.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace oted {

/// Not thread-safe; to be used on the thread that made it.
class Renderer {
 public:
  virtual ~Renderer() = default;

  /// A simulator with parameters `z` in `pose` (Simulator::pose).
  /// @return (height, width, 3) bytes, red green blue, the top row first; valid until the next call
  /// @throws DataError when it cannot be drawn.
  virtual const std::vector<uint8_t>& Draw(std::span<const double> z, std::span<const double> pose) = 0;

  virtual int width() const = 0;
  virtual int height() const = 0;
  virtual const std::string& description() const = 0;  ///< what draws: "EGL, llvmpipe (...)"
};

}  // namespace oted
