// In place of on_device.cc where the program is built without libtorch.
#include "oted/base/error.h"
#include "oted/rl/autograd/on_device.h"

namespace oted {

void CheckDevice(const std::string& device) {
  if (device == "cpu") return;
  throw UsageError("device " + device +
                   ": this program was built without libtorch; build it with 'make build-cuda', or leave "
                   "agents.device at cpu");
}

std::unique_ptr<ReplayUpdate> OnDevice(SacUpdate, const SacUpdateOptions&, const std::string& device) {
  CheckDevice(device);
  throw InternalError("no learner on autograd without libtorch");
}

std::unique_ptr<ReplayUpdate> OnDevice(CrossQUpdate, const CrossQUpdateOptions&, const std::string& device) {
  CheckDevice(device);
  throw InternalError("no learner on autograd without libtorch");
}

}  // namespace oted
