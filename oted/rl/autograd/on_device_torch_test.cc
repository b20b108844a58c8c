#include <gmock/gmock.h>
#include <torch/cuda.h>

#include "oted/base/error.h"
#include "oted/nn/torch_testing.h"
#include "oted/rl/autograd/on_device.h"
#include "oted/rl/replay_torch_testing.h"

namespace oted::on_device_torch_test {

constexpr int kObsDim = 11, kActDim = 3;
const std::vector<int> kHidden = {64, 64};

TanhGaussianPolicy MakePolicy() {
  return TanhGaussianPolicy({std::vector<double>(kObsDim, 0.0), std::vector<double>(kObsDim, 1.0)}, kHidden,
                            std::vector<double>(kActDim, -1.0), std::vector<double>(kActDim, 1.0));
}

struct Sac {
  using Update = SacUpdate;
  static constexpr SacUpdateOptions kOptions{.target_entropy = -kActDim};
  static SacUpdate Make() {
    Rng rng(11);
    TanhGaussianPolicy actor = MakePolicy();
    actor.net().Initialize(rng);
    return SacUpdate(std::move(actor), kHidden, kOptions, rng);
  }
};

struct CrossQ {
  using Update = CrossQUpdate;
  static constexpr CrossQUpdateOptions kOptions{.learning_rate = 3e-4, .target_entropy = -kActDim, .renorm_warmup = 20};
  static CrossQUpdate Make() {
    Rng rng(11);
    return CrossQUpdate(MakePolicy(), kHidden, kOptions, rng);
  }
};

/// The processor, and a GPU where there is one.
std::vector<TrainingDevice> Devices() {
  try {
    CheckDevice(TrainingDevice::kCuda);
    return {TrainingDevice::kCpu, TrainingDevice::kCuda};
  } catch (const UsageError&) {
    return {TrainingDevice::kCpu};
  }
}

template <class Algorithm>
class OnDeviceTest : public testing::Test {
 protected:
  static std::unique_ptr<ReplayUpdate> Make(TrainingDevice device) {
    return OnDevice(Algorithm::Make(), Algorithm::kOptions, device);
  }
  static AlignedVector<float> Parameters(const ReplayUpdate& update) { return update.actor().net().parameters(); }
};

using Algorithms = testing::Types<Sac, CrossQ>;
TYPED_TEST_SUITE(OnDeviceTest, Algorithms);

// Both are in single precision, so twice the rounding of the tests against double precision.
TYPED_TEST(OnDeviceTest, FollowsTheHandWrittenUpdateOverSixtySteps) {
  torch::set_num_threads(1);
  for (const TrainingDevice device : Devices()) {
    auto update = TypeParam::Make();
    const auto on_device = this->Make(device);
    const auto start = this->Parameters(update);
    EXPECT_EQ(this->Parameters(*on_device), start) << NameOf(TrainingDeviceNames(), device);
    Rng rng(12);
    for (int step = 0; step < 60; ++step) {
      const TransitionBatch batch = RandomBatch(kObsDim, kActDim, rng);
      const ReplayLosses want = update.Step(batch), got = on_device->Step(batch);
      ExpectNear(got, want, step, 1e-4);
    }
    EXPECT_LT(MaxDifference(this->Parameters(*on_device), this->Parameters(update)), 2e-4)
        << NameOf(TrainingDeviceNames(), device);
    EXPECT_GT(MaxDifference(this->Parameters(*on_device), start), 2e-3) << NameOf(TrainingDeviceNames(), device);
  }
}

TYPED_TEST(OnDeviceTest, ACheckpointGoesOnThereAndBack) {
  torch::set_num_threads(1);
  for (const TrainingDevice device : Devices()) {
    auto update = TypeParam::Make();
    Rng rng(13);
    for (int step = 0; step < 7; ++step) update.Step(RandomBatch(kObsDim, kActDim, rng));
    NpzArrays there;
    update.Save(there);
    const auto on_device = this->Make(device);
    on_device->Restore(ParseNpz(NpzBytes(there), "memory"));
    EXPECT_EQ(this->Parameters(*on_device), this->Parameters(update)) << NameOf(TrainingDeviceNames(), device);
    NpzArrays unchanged;
    on_device->Save(unchanged);
    EXPECT_EQ(NpzBytes(unchanged), NpzBytes(there)) << NameOf(TrainingDeviceNames(), device);

    // Moments and counters came along: without them parameters would part by some learning rate, 3e-4, at once.
    const TransitionBatch batch = RandomBatch(kObsDim, kActDim, rng);
    update.Step(batch), on_device->Step(batch);
    NpzArrays back;
    on_device->Save(back);
    auto returned = TypeParam::Make();
    returned.Restore(ParseNpz(NpzBytes(back), "memory"));
    for (int step = 0; step < 3; ++step) {
      const TransitionBatch next = RandomBatch(kObsDim, kActDim, rng);
      const ReplayLosses want = update.Step(next), got = returned.Step(next);
      if (step > 0) ExpectNear(got, want, step, 1e-5);  // before, the actor's losses may be of a step not seen
    }
    EXPECT_LT(MaxDifference(this->Parameters(returned), this->Parameters(update)), 1e-5)
        << NameOf(TrainingDeviceNames(), device);
  }
}

TEST(OnDevice, WhatIsMissingForCudaIsSaid) {
  CheckDevice(TrainingDevice::kCpu);
  if (Devices().size() == 2) GTEST_SKIP() << "there is a GPU";
  try {
    CheckDevice(TrainingDevice::kCuda);
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("device cuda: "));
    EXPECT_THAT(error.what(), testing::HasSubstr("leave agents.device at cpu"));
  }
}

}  // namespace oted::on_device_torch_test
