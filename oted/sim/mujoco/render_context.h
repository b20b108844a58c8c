#pragma once
/// An OpenGL context without a window, for MuJoCo's renderer. The libraries are looked for when the program runs: it
/// links none of them, and works where there are none.

#include <memory>
#include <string>

namespace oted {

/// Current on the thread that made it, until destroyed. One at a time per process.
class RenderContext {
 public:
  /// EGL (a GPU's driver, or Mesa's software renderer without any display), else OSMesa. The environment variable
  /// MUJOCO_GL narrows the choice, as it does for MuJoCo in Python: egl, osmesa, or off, disable, false, 0 for none.
  /// @return null where no context can be made; `why_not` then says so in one line, with the remedy
  static std::unique_ptr<RenderContext> Make(std::string* why_not);
  virtual ~RenderContext() = default;
  RenderContext(const RenderContext&) = delete;
  RenderContext& operator=(const RenderContext&) = delete;

  /// "EGL, llvmpipe (LLVM 15.0.6, 256 bits)".
  const std::string& description() const { return description_; }

 protected:
  RenderContext() = default;
  std::string description_;
};

}  // namespace oted
