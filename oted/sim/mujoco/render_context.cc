#include "oted/sim/mujoco/render_context.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <array>
#include <cstdlib>
#include <functional>
#include <string_view>
#include <vector>

namespace oted {
namespace {

// The few names of EGL 1.5, OSMesa 8 and OpenGL that are used here (registry.khronos.org, mesa3d.org), so that neither
// headers nor libraries are needed to build.
constexpr int kEglNone = 0x3038, kEglOpenglApi = 0x30A2, kEglSurfaceType = 0x3033, kEglRenderableType = 0x3040;
constexpr int kEglOpenglBit = 0x0008;
constexpr unsigned kPlatformDevice = 0x313F, kPlatformSurfaceless = 0x31DD;
constexpr int kOsmesaRgba = 0x1908;
constexpr unsigned kGlUnsignedByte = 0x1401, kGlRenderer = 0x1F01, kGlVersion = 0x1F02;
constexpr const char* kRemedy = "install libegl1 and libgl1-mesa-dri (Debian's names), which need no graphics card";

using Function = void (*)();

/// A shared library. It stays loaded once it was used: drivers register exit handlers that must not vanish.
class Library {
 public:
  explicit Library(const char* name) : handle_(dlopen(name, RTLD_NOW | RTLD_GLOBAL)) {}
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  bool is_open() const { return handle_ != nullptr; }
  template <class F>
  bool Find(const char* name, F* function) const {
    *function = reinterpret_cast<F>(dlsym(handle_, name));
    return *function != nullptr;
  }
  /// For one that gave no context: MuJoCo takes its functions from such a library wherever the process holds one.
  void Close() {
    if (handle_ != nullptr) dlclose(handle_);
  }

 private:
  void* handle_;
};

// What mjr_makeContext needs of the current context; it ends the process where that is missing.
bool IsUsable(const std::function<Function(const char*)>& address, std::string* renderer) {
  using GetString = const unsigned char* (*)(unsigned);
  const auto get_string = reinterpret_cast<GetString>(address("glGetString"));
  if (get_string == nullptr || address("glGenFramebuffers") == nullptr || address("glGenBuffers") == nullptr) {
    return false;
  }
  const auto text = [&](unsigned name) {
    const unsigned char* value = get_string(name);
    return std::string(value == nullptr ? "" : reinterpret_cast<const char*>(value));
  };
  const std::string version = text(kGlVersion);
  *renderer = text(kGlRenderer);
  // "4.5 (Compatibility Profile) Mesa ..."; OpenGL ES begins with its name. 3.0 has all extensions that are used.
  return !version.empty() && version.front() >= '3' && version.front() <= '9';
}

class EglContext : public RenderContext {
 public:
  ~EglContext() override {
    if (display_ == nullptr) {
      library_.Close();
      return;
    }
    make_current_(display_, nullptr, nullptr, nullptr);
    if (context_ != nullptr) destroy_context_(display_, context_);
    terminate_(display_);
  }

  bool Open() {
    if (!library_.is_open() || !FindFunctions()) return false;
    if (Use(platform_display_(kPlatformSurfaceless, nullptr, nullptr))) return true;
    std::array<void*, 16> devices{};
    int n = 0;
    if (query_devices_ != nullptr && query_devices_(static_cast<int>(devices.size()), devices.data(), &n) != 0) {
      for (int i = 0; i < n; ++i) {
        if (Use(platform_display_(kPlatformDevice, devices[static_cast<size_t>(i)], nullptr))) return true;
      }
    }
    return false;
  }

 private:
  bool FindFunctions() {
    if (!library_.Find("eglGetProcAddress", &address_) || !library_.Find("eglInitialize", &initialize_) ||
        !library_.Find("eglTerminate", &terminate_) || !library_.Find("eglBindAPI", &bind_api_) ||
        !library_.Find("eglChooseConfig", &choose_config_) || !library_.Find("eglCreateContext", &create_context_) ||
        !library_.Find("eglDestroyContext", &destroy_context_) || !library_.Find("eglMakeCurrent", &make_current_)) {
      return false;
    }
    platform_display_ = reinterpret_cast<decltype(platform_display_)>(address_("eglGetPlatformDisplayEXT"));
    query_devices_ = reinterpret_cast<decltype(query_devices_)>(address_("eglQueryDevicesEXT"));
    return platform_display_ != nullptr;
  }

  // A context on `display`, current without a surface: MuJoCo draws into a buffer of its own.
  bool Use(void* display) {
    int major = 0, minor = 0;
    if (display == nullptr || initialize_(display, &major, &minor) == 0) return false;
    const std::array<int, 5> wanted = {kEglSurfaceType, 0, kEglRenderableType, kEglOpenglBit, kEglNone};
    void* config = nullptr;  // null is EGL_NO_CONFIG_KHR
    int n = 0;
    if (choose_config_(display, wanted.data(), &config, 1, &n) == 0 || n == 0) config = nullptr;
    void* context = bind_api_(kEglOpenglApi) != 0 ? create_context_(display, config, nullptr, nullptr) : nullptr;
    std::string renderer;
    if (context != nullptr && make_current_(display, nullptr, nullptr, context) != 0 && IsUsable(address_, &renderer)) {
      display_ = display;
      context_ = context;
      description_ = "EGL, " + renderer;
      return true;
    }
    make_current_(display, nullptr, nullptr, nullptr);
    if (context != nullptr) destroy_context_(display, context);
    terminate_(display);
    return false;
  }

  Library library_{"libEGL.so.1"};
  void* display_ = nullptr;
  void* context_ = nullptr;
  Function (*address_)(const char*) = nullptr;
  unsigned (*initialize_)(void*, int*, int*) = nullptr;
  unsigned (*terminate_)(void*) = nullptr;
  unsigned (*bind_api_)(unsigned) = nullptr;
  unsigned (*choose_config_)(void*, const int*, void**, int, int*) = nullptr;
  void* (*create_context_)(void*, void*, void*, const int*) = nullptr;
  unsigned (*destroy_context_)(void*, void*) = nullptr;
  unsigned (*make_current_)(void*, void*, void*, void*) = nullptr;
  void* (*platform_display_)(unsigned, void*, const int*) = nullptr;
  unsigned (*query_devices_)(int, void**, int*) = nullptr;
};

class OsmesaContext : public RenderContext {
 public:
  ~OsmesaContext() override {
    if (context_ != nullptr) destroy_(context_);
  }

  bool Open() {
    if (!library_.is_open() || !library_.Find("OSMesaGetProcAddress", &address_) ||
        !library_.Find("OSMesaCreateContextExt", &create_) || !library_.Find("OSMesaMakeCurrent", &make_current_) ||
        !library_.Find("OSMesaDestroyContext", &destroy_)) {
      return false;
    }
    context_ = create_(kOsmesaRgba, 24, 8, 0, nullptr);
    std::string renderer;
    // It insists on a picture of its own, however small.
    if (context_ == nullptr || make_current_(context_, pixels_.data(), kGlUnsignedByte, kSide, kSide) == 0 ||
        !IsUsable(address_, &renderer)) {
      return false;
    }
    description_ = "OSMesa, " + renderer;
    return true;
  }

 private:
  static constexpr int kSide = 16;
  Library library_{"libOSMesa.so.8"};
  void* context_ = nullptr;
  std::vector<unsigned char> pixels_ = std::vector<unsigned char>(4 * kSide * kSide);
  Function (*address_)(const char*) = nullptr;
  void* (*create_)(unsigned, int, int, int, void*) = nullptr;
  unsigned char (*make_current_)(void*, void*, unsigned, int, int) = nullptr;
  void (*destroy_)(void*) = nullptr;
};

}  // namespace

std::unique_ptr<RenderContext> RenderContext::Make(std::string* why_not) {
  const char* const named = std::getenv("MUJOCO_GL");
  const std::string_view choice = named == nullptr ? "" : named;
  if (choice == "off" || choice == "disable" || choice == "disabled" || choice == "false" || choice == "0") {
    *why_not = fmt::format("MUJOCO_GL={} turns OpenGL off; unset it", choice);
    return nullptr;
  }
  if (choice != "osmesa") {
    auto context = std::make_unique<EglContext>();
    if (context->Open()) return context;
  }
  if (choice != "egl") {
    auto context = std::make_unique<OsmesaContext>();
    if (context->Open()) return context;
  }
  *why_not = fmt::format("no OpenGL context can be made{}; {}",
                         choice.empty() ? "" : fmt::format(" with MUJOCO_GL={}", choice), kRemedy);
  return nullptr;
}

}  // namespace oted
