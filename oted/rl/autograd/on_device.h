#pragma once
/// A learner's gradient steps on a device other than the processor, by libtorch's autograd. Where the program is built
/// without libtorch there is none.

#include <memory>

#include "oted/rl/crossq_update.h"
#include "oted/rl/sac_update.h"

namespace oted {

/// @param device  kCpu: always there; kCuda: the first GPU that CUDA_VISIBLE_DEVICES leaves
/// @throws UsageError saying what is missing
void CheckDevice(TrainingDevice device);

/// `start`, going on there. Its actor() follows on the processor after every step; Save writes the arrays that `start`
/// would, and Restore reads them, wherever they come from. Numbers are those of `start` up to single precision's
/// rounding.
/// @param device   kCpu: autograd on the processor
/// @param options  those of `start`
/// @throws as CheckDevice
std::unique_ptr<ReplayUpdate> OnDevice(SacUpdate start, const SacUpdateOptions& options, TrainingDevice device);
std::unique_ptr<ReplayUpdate> OnDevice(CrossQUpdate start, const CrossQUpdateOptions& options, TrainingDevice device);

}  // namespace oted
