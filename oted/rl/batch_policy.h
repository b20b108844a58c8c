#pragma once
/// Policies as the callbacks that rollouts take.

#include <filesystem>
#include <string>

#include "oted/nn/onnx_export.h"
#include "oted/nn/tanh_gaussian.h"
#include "oted/sim/rollout.h"

namespace oted {

/// `policy` with sampled or mean actions; copies share one stream, `rng`, and scratch memory, so use it from one
/// thread. `policy` must outlive it.
BatchPolicy AsBatchPolicy(const Policy& policy, ActionNoise noise, Rng rng);
/// The mean action, which draws nothing; of a planner, whose plans are drawn, those of one fixed stream.
BatchPolicy MeanActionPolicy(const Policy& policy);

/// The policy of a file, by its ending: .npz, ours, or .onnx (nn/onnx_policy.h). It acts deterministically, but for
/// discrete actions where `discrete` says kSampled and the file has their probabilities; of an ONNX file, these are its
/// output `logits`, or one as wide as there are actions. The policy is held by what is returned. An action that is not
/// finite, or no index where actions are discrete, is a DataError that names the file.
/// @param rng  of the draws
/// @throws DataError: unreadable, or of other dimensions or actions than `spec`'s
BatchPolicy LoadBatchPolicy(const std::filesystem::path& path, const SimulatorSpec& spec,
                            ActionNoise discrete = ActionNoise::kMean, Rng rng = Rng(0));

/// What a policy's ONNX file says of where it came from: task, observation and action names (JSON lists), control
/// period [s], version, and `source`, the run and agent that made it.
OnnxMetadata PolicyMetadata(const SimulatorSpec& spec, const std::string& source);

}  // namespace oted
