#include "oted/nn/onnx_export.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>
#include <nlohmann/json.hpp>
#include <protozero/pbf_writer.hpp>
#include <span>
#include <vector>

#include "oted/base/files.h"

namespace oted {
namespace {

using protozero::pbf_writer;

constexpr int kFloat = 1;  // TensorProto.DataType

/// Field numbers of onnx.proto3.
namespace field {
namespace model {
enum { kIrVersion = 1, kProducerName = 2, kProducerVersion = 3, kGraph = 7, kOpsetImport = 8, kMetadata = 14 };
}
namespace graph {
enum { kNode = 1, kName = 2, kInitializer = 5, kInput = 11, kOutput = 12 };
}
namespace node {
enum { kInput = 1, kOutput = 2, kName = 3, kOpType = 4 };
}
namespace tensor {
enum { kDims = 1, kDataType = 2, kName = 8, kRawData = 9 };
}
}  // namespace field

/// Collects the nodes and constants of a graph in which each value has one name.
class GraphWriter {
 public:
  /// A constant of the given shape; an empty shape is a scalar.
  std::string Constant(const std::string& name, std::vector<int64_t> shape, std::span<const float> values) {
    pbf_writer tensor(graph_, field::graph::kInitializer);
    tensor.add_packed_int64(field::tensor::kDims, shape.begin(), shape.end());
    tensor.add_int32(field::tensor::kDataType, kFloat);
    tensor.add_string(field::tensor::kName, name);
    static_assert(std::endian::native == std::endian::little, "raw_data is little-endian");
    tensor.add_bytes(field::tensor::kRawData, reinterpret_cast<const char*>(values.data()), values.size_bytes());
    return name;
  }
  std::string Vector(const std::string& name, const std::vector<float>& values) {
    return Constant(name, {static_cast<int64_t>(values.size())}, values);
  }
  /// A node with one output, which has the node's name.
  std::string Node(const char* op, const std::string& output, const std::vector<std::string>& inputs) {
    pbf_writer node(graph_, field::graph::kNode);
    for (const std::string& input : inputs) node.add_string(field::node::kInput, input);
    node.add_string(field::node::kOutput, output);
    node.add_string(field::node::kName, output);
    node.add_string(field::node::kOpType, op);
    return output;
  }
  /// A float32 (batch, width) input or output.
  void Interface(bool is_input, const std::string& name, int width) {
    pbf_writer info(graph_, is_input ? field::graph::kInput : field::graph::kOutput);
    info.add_string(1, name);
    pbf_writer type(info, 2);
    pbf_writer tensor(type, 1);
    tensor.add_int32(1, kFloat);
    pbf_writer shape(tensor, 2);
    pbf_writer(shape, 1).add_string(2, "batch");
    pbf_writer(shape, 1).add_int64(1, width);
  }
  void Name(const std::string& name) { graph_.add_string(field::graph::kName, name); }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  pbf_writer graph_{bytes_};
};

/// (observation - mean) / scale. The mean in two float32 parts: where it is large beside the scale, one would lose what
/// the program's own double precision keeps.
std::string Normalize(GraphWriter& graph, const Normalizer& normalizer, std::string x) {
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
std::string Linear(GraphWriter& graph, const Mlp& net, const Mlp::Layer& layer, int begin, int width,
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
  GraphWriter graph;
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
  std::string bytes;
  pbf_writer model(bytes);
  model.add_int64(field::model::kIrVersion, kOnnxIrVersion);
  model.add_string(field::model::kProducerName, "oted");
  model.add_string(field::model::kProducerVersion, OTED_VERSION);
  model.add_message(field::model::kGraph, GraphBytes(policy));
  pbf_writer(model, field::model::kOpsetImport).add_int64(2, kOnnxOpset);
  OnnxMetadata all = metadata;
  all["action_low"] = nlohmann::json(policy.action_low()).dump();
  all["action_high"] = nlohmann::json(policy.action_high()).dump();
  for (const auto& [key, value] : all) {
    pbf_writer entry(model, field::model::kMetadata);
    entry.add_string(1, key);
    entry.add_string(2, value);
  }
  return bytes;
}

void WriteOnnx(const TanhGaussianPolicy& policy, const OnnxMetadata& metadata, const std::filesystem::path& path) {
  WriteFileAtomically(path, OnnxBytes(policy, metadata));
}

}  // namespace oted
