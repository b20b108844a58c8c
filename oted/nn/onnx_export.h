#pragma once
/// A policy as an ONNX model: what leaves the program (docs/file_formats.md, policy.onnx).

#include <filesystem>
#include <string>

#include "oted/nn/onnx_graph.h"
#include "oted/nn/tanh_gaussian.h"

namespace oted {

/// The bytes of a model with all of the policy in its graph, float32 throughout:
///   input   observation (batch, obs_dim), raw
///   output  action      (batch, act_dim), the mean action in the actuators' range
///           mean        (batch, act_dim), of u, before tanh
///           log_std     (batch, act_dim), of u, clamped as in sampling
/// A sampled action is centre + half range * tanh(mean + exp(log_std) * noise), noise ~ N(0, 1); action_low and
/// action_high are added to `metadata` for it. Equal policies and metadata give equal bytes.
std::string OnnxBytes(const TanhGaussianPolicy& policy, const OnnxMetadata& metadata);

/// That of whichever policy it is. @throws UsageError for one without an ONNX form (Policy::has_onnx)
std::string OnnxBytes(const Policy& policy, const OnnxMetadata& metadata);

/// Writes them, atomically. @throws DataError
void WriteOnnx(const Policy& policy, const OnnxMetadata& metadata, const std::filesystem::path& path);

}  // namespace oted
