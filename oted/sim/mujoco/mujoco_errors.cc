#include "oted/sim/mujoco/mujoco_errors.h"

#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <mutex>
#include <string_view>

#include "oted/base/error.h"

namespace oted {
namespace {

// MuJoCo is C, or C++ that lets exceptions pass: its functions have unwind tables on every platform that this program
// is built for, and hold nothing between the error and the call that would have to be destroyed.
[[noreturn]] void ThrowError(const char* message) {
  const bool is_memory = std::string_view(message).find("allocate memory") != std::string_view::npos;
  throw DataError(fmt::format("MuJoCo {} cannot go on: {}; {}", mj_versionString(), message,
                              is_memory ? "free memory, or take fewer threads (--threads)" : "correct the model"));
}

thread_local std::vector<std::string>* listening = nullptr;

}  // namespace

MujocoWarnings::MujocoWarnings() { listening = &told_; }
MujocoWarnings::~MujocoWarnings() { listening = nullptr; }

void TakeOverMujocoErrors() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (mju_user_warning == nullptr)
      mju_user_warning = [](const char* message) {
        if (listening != nullptr) listening->emplace_back(message);
      };
    if (mju_user_error == nullptr) mju_user_error = [](const char* message) { ThrowError(message); };
  });
}

}  // namespace oted
