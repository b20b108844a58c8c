#pragma once
/// A policy over discrete actions as an ONNX graph: the encoder, convolutions, linear layers, the most probable action.

#include <string>

#include "oted/nn/categorical_policy.h"
#include "oted/nn/onnx_graph.h"

namespace oted {

/// The bytes of a model with all of a policy over discrete actions in its graph, with one-hot encoding, normalisation
/// and convolutions in it:
///   input   observation (batch, obs_dim), raw, an image flattened as the task shows it
///   output  action      (batch, 1), int64, the most probable one
///           logits      (batch, n_actions): action i has the probability softmax(logits)_i
/// n_actions is added to `metadata`.
std::string OnnxBytes(const CategoricalPolicy& policy, const OnnxMetadata& metadata);

}  // namespace oted
