#include "oted/rl/autograd/on_device.h"

#include <dlfcn.h>
#include <torch/cuda.h>

#include <algorithm>
#include <utility>

#include "oted/base/error.h"
#include "oted/rl/autograd/autograd_crossq.h"
#include "oted/rl/autograd/autograd_sac.h"

namespace oted {

namespace {

void ToHost(const torch::Tensor& from, AlignedVector<float>& to) {
  const torch::Tensor here = from.to(torch::kCPU, torch::kFloat32).contiguous();
  OTED_CHECK(static_cast<size_t>(here.numel()) == to.size());
  std::copy_n(here.data_ptr<float>(), to.size(), to.begin());
}

void ToDevice(const AlignedVector<float>& from, torch::Tensor to) {
  to.copy_(ToTensor(from, 1, static_cast<int64_t>(from.size()), torch::kFloat32).flatten());
}

/// Calls copy(host vector, device tensor) and count(host counter, device counter) for everything that both hold.
template <class Copy, class Count>
void Pair(const LearnedState& host, const AutogradState& device, const Copy& copy, const Count& count) {
  OTED_CHECK(host.values().size() == device.values.size() && host.optimisers().size() == device.n_steps.size());
  for (size_t i = 0; i < device.values.size(); ++i) {
    OTED_CHECK(host.values()[i].first == device.values[i].first);
    copy(*host.values()[i].second, device.values[i].second);
  }
  for (size_t i = 0; i < device.n_steps.size(); ++i) count(host.optimisers()[i]->n_steps(), *device.n_steps[i]);
}

/// What acts, after a step: SAC's actor, and CrossQ's with its running statistics folded in.
void CopyActor(const AutogradSac& from, SacUpdate& to) { ToHost(from.actor.flat, to.actor_net().parameters()); }
void CopyActor(const AutogradCrossQ& from, CrossQUpdate& to) {
  ToHost(from.actor.flat, to.actor_net().parameters());
  ToHost(from.actor.running, to.actor_net().running());
  to.FoldActor();
}

/// `Host` keeps the names of what is saved, and the policy that acts.
template <class Host, class Device, class Options>
class UpdateOnDevice : public ReplayUpdate {
 public:
  UpdateOnDevice(Host start, const Options& options, const torch::Device& device)
      : host_(std::move(start)), device_(host_, options, torch::TensorOptions(torch::kFloat32).device(device)) {
    CopyToDevice();
  }

  ReplayLosses Step(const TransitionBatch& batch) override {
    const ReplayLosses losses = device_.Step(batch);
    CopyActor(device_, host_);
    return losses;
  }
  const TanhGaussianPolicy& actor() const override { return host_.actor(); }
  void Save(NpzArrays& arrays) override {
    Pair(
        host_.State(), device_.State(), [](auto& host, const auto& device) { ToHost(device, host); },
        [](int64_t& host, int64_t device) { host = device; });
    host_.Save(arrays);
  }
  void Restore(const NpzArrays& arrays) override {
    host_.Restore(arrays);
    CopyToDevice();
  }

 private:
  void CopyToDevice() {
    Pair(
        host_.State(), device_.State(), [](const auto& host, const auto& device) { ToDevice(host, device); },
        [](int64_t host, int64_t& device) { device = host; });
  }

  Host host_;
  Device device_;
};

torch::Device FindDevice(TrainingDevice device) {
  CheckDevice(device);
  return device == TrainingDevice::kCuda ? torch::Device(torch::kCUDA, 0) : torch::Device(torch::kCPU);
}

}  // namespace

void CheckDevice(TrainingDevice device) {
  if (device == TrainingDevice::kCpu) return;
  // Not linked: it is gigabytes to load, and a CPU build of libtorch has none. Loading it registers it with libtorch,
  // which asks once whether there is CUDA and remembers the answer: so before anything else of libtorch runs.
  if (dlopen("libtorch_cuda.so", RTLD_NOW | RTLD_GLOBAL) == nullptr) {
    throw UsageError(
        "device cuda: the libtorch that this program runs with is a build without CUDA; install a torch wheel with "
        "CUDA into .venv (requirements.txt has the version) and build again, or leave agents.device at cpu");
  }
  if (!torch::cuda::is_available()) {
    throw UsageError(
        "device cuda: no GPU can be used; nvidia-smi lists those that the driver knows, CUDA_VISIBLE_DEVICES may hide "
        "them; or leave agents.device at cpu");
  }
}

std::unique_ptr<ReplayUpdate> OnDevice(SacUpdate start, const SacUpdateOptions& options, TrainingDevice device) {
  return std::make_unique<UpdateOnDevice<SacUpdate, AutogradSac, SacUpdateOptions>>(std::move(start), options,
                                                                                    FindDevice(device));
}

std::unique_ptr<ReplayUpdate> OnDevice(CrossQUpdate start, const CrossQUpdateOptions& options, TrainingDevice device) {
  return std::make_unique<UpdateOnDevice<CrossQUpdate, AutogradCrossQ, CrossQUpdateOptions>>(std::move(start), options,
                                                                                             FindDevice(device));
}

}  // namespace oted
