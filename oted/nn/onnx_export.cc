#include "oted/nn/onnx_export.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <vector>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/nn/onnx_export_categorical.h"
#include "oted/nn/onnx_graph.h"

namespace oted {
namespace {

/// (observation - mean) / scale. The mean in two float32 parts: where it is large beside the scale, one would lose what
/// the program's own double precision keeps.
std::string Normalize(OnnxGraph& graph, const Normalizer& normalizer, std::string x) {
  std::vector<float> high, low, scale;
  bool identity = true;
  for (size_t j = 0; j < normalizer.mean.size(); ++j) {
    high.push_back(static_cast<float>(normalizer.mean[j]));
    low.push_back(static_cast<float>(normalizer.mean[j] - static_cast<double>(high.back())));
    scale.push_back(static_cast<float>(normalizer.scale[j]));
    identity = identity && normalizer.mean[j] == 0 && normalizer.scale[j] == 1;
  }
  if (identity) return x;
  x = graph.Node("Sub", "centred", {x, graph.Vector("observation_mean", high)});
  x = graph.Node("Sub", "centred_rest", {x, graph.Vector("observation_mean_rest", low)});
  return graph.Node("Div", "normalized", {x, graph.Vector("observation_scale", scale)});
}

/// Columns [begin, begin + width) of a layer as a product of its own: heads without slicing.
std::string Linear(OnnxGraph& graph, const Mlp& net, const Mlp::Layer& layer, int begin, int width,
                   const std::string& name, const std::string& x) {
  const float* p = net.parameters().data();
  std::vector<float> weight, bias(p + layer.bias + begin, p + layer.bias + begin + width);
  for (int i = 0; i < layer.in; ++i) {
    const float* row = p + layer.weight + static_cast<size_t>(i) * static_cast<size_t>(layer.out) + begin;
    weight.insert(weight.end(), row, row + width);
  }
  const std::string w = graph.Constant(name + ".weight", {layer.in, width}, weight);
  return graph.Node("Gemm", name, {x, w, graph.Vector(name + ".bias", bias)});
}

std::string GraphBytes(const TanhGaussianPolicy& policy) {
  OnnxGraph graph;
  graph.Name("policy");
  graph.Interface(true, "observation", policy.obs_dim());
  for (const char* name : {"action", "mean", "log_std"}) graph.Interface(false, name, policy.act_dim());

  std::string x = Normalize(graph, policy.normalizer(), "observation");
  const Mlp& net = policy.net();
  const size_t last = net.layers().size() - 1;
  for (size_t k = 0; k < last; ++k) {
    const std::string name = fmt::format("layer{}", k + 1);
    x = graph.Node("Relu", name + ".relu", {Linear(graph, net, net.layers()[k], 0, net.layers()[k].out, name, x)});
  }
  const int act_dim = policy.act_dim();
  Linear(graph, net, net.layers()[last], 0, act_dim, "mean", x);
  Linear(graph, net, net.layers()[last], act_dim, act_dim, "log_std.raw", x);

  std::vector<float> center, half_range;
  for (size_t j = 0; j < policy.action_low().size(); ++j) {
    center.push_back(static_cast<float>(0.5 * (policy.action_low()[j] + policy.action_high()[j])));
    half_range.push_back(static_cast<float>(0.5 * (policy.action_high()[j] - policy.action_low()[j])));
  }
  x = graph.Node("Tanh", "squashed", {"mean"});
  x = graph.Node("Mul", "scaled", {x, graph.Vector("action_half_range", half_range)});
  graph.Node("Add", "action", {x, graph.Vector("action_centre", center)});
  const std::string low = graph.Constant("log_std.min", {}, {&kLogStdMin, 1});
  graph.Node("Clip", "log_std", {"log_std.raw", low, graph.Constant("log_std.max", {}, {&kLogStdMax, 1})});
  return graph.bytes();
}

}  // namespace

std::string OnnxBytes(const TanhGaussianPolicy& policy, const OnnxMetadata& metadata) {
  OnnxMetadata all = metadata;
  all["action_low"] = nlohmann::json(policy.action_low()).dump();
  all["action_high"] = nlohmann::json(policy.action_high()).dump();
  return OnnxModel(GraphBytes(policy), all);
}

std::string OnnxBytes(const Policy& policy, const OnnxMetadata& metadata) {
  if (const auto* categorical = dynamic_cast<const CategoricalPolicy*>(&policy)) {
    return OnnxBytes(*categorical, metadata);
  }
  if (!policy.has_onnx()) {
    throw UsageError(
        "a planner (mbop) simulates at every step and is no graph from observation to action: it has no ONNX form; use "
        "its policy.npz with this program");
  }
  return OnnxBytes(dynamic_cast<const TanhGaussianPolicy&>(policy), metadata);
}

void WriteOnnx(const Policy& policy, const OnnxMetadata& metadata, const std::filesystem::path& path) {
  WriteFileAtomically(path, OnnxBytes(policy, metadata));
}

}  // namespace oted
