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
/// The mean action, which draws nothing.
BatchPolicy MeanActionPolicy(const Policy& policy);

/// The deterministic action of a policy file, by its ending: .npz, ours, or .onnx (nn/onnx_policy.h). The policy is
/// held by what is returned. An action that is not finite is a DataError that names the file.
/// @throws DataError: unreadable, or of other dimensions than `spec`'s
BatchPolicy LoadBatchPolicy(const std::filesystem::path& path, const SimulatorSpec& spec);

/// What a policy's ONNX file says of where it came from: task, observation and action names (JSON lists), control
/// period [s], version, and `source`, the run and agent that made it.
OnnxMetadata PolicyMetadata(const SimulatorSpec& spec, const std::string& source);

}  // namespace oted
