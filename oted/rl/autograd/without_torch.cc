// In place of on_device.cc where the program is built without libtorch.
#include "oted/base/error.h"
#include "oted/rl/autograd/on_device.h"

namespace oted {

void CheckDevice(TrainingDevice device) {
  if (device == TrainingDevice::kCpu) return;
  throw UsageError(
      "device cuda: this program was built without libtorch; build it with 'make build-cuda', or leave "
      "agents.device at cpu");
}

std::unique_ptr<ReplayUpdate> OnDevice(SacUpdate, const SacUpdateOptions&, TrainingDevice device) {
  CheckDevice(device);
  throw InternalError("no learner on autograd without libtorch");
}

std::unique_ptr<ReplayUpdate> OnDevice(CrossQUpdate, const CrossQUpdateOptions&, TrainingDevice device) {
  CheckDevice(device);
  throw InternalError("no learner on autograd without libtorch");
}

}  // namespace oted
