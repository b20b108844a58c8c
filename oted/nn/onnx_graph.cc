#include "oted/nn/onnx_graph.h"

#include <bit>

namespace oted {

using protozero::pbf_writer;

namespace {

/// Field numbers of onnx.proto3.
namespace field {
namespace model {
enum { kIrVersion = 1, kProducerName = 2, kProducerVersion = 3, kGraph = 7, kOpsetImport = 8, kMetadata = 14 };
}
namespace graph {
enum { kNode = 1, kName = 2, kInitializer = 5, kInput = 11, kOutput = 12 };
}
namespace node {
enum { kInput = 1, kOutput = 2, kName = 3, kOpType = 4, kAttribute = 5 };
}
namespace attribute {
enum { kName = 1, kInt = 3, kType = 20 };
constexpr int kIntType = 2;  // AttributeProto.AttributeType
}  // namespace attribute
namespace tensor {
enum { kDims = 1, kDataType = 2, kName = 8, kRawData = 9 };
}
}  // namespace field

template <class T>
void AddTensor(pbf_writer& graph, const std::string& name, const std::vector<int64_t>& shape, std::span<const T> values,
               OnnxType type) {
  pbf_writer tensor(graph, field::graph::kInitializer);
  tensor.add_packed_int64(field::tensor::kDims, shape.begin(), shape.end());
  tensor.add_int32(field::tensor::kDataType, static_cast<int>(type));
  tensor.add_string(field::tensor::kName, name);
  static_assert(std::endian::native == std::endian::little, "raw_data is little-endian");
  tensor.add_bytes(field::tensor::kRawData, reinterpret_cast<const char*>(values.data()), values.size_bytes());
}

}  // namespace

std::string OnnxGraph::Constant(const std::string& name, const std::vector<int64_t>& shape,
                                std::span<const float> values) {
  AddTensor(graph_, name, shape, values, OnnxType::kFloat);
  return name;
}

std::string OnnxGraph::Constant(const std::string& name, const std::vector<int64_t>& shape,
                                std::span<const int64_t> values) {
  AddTensor(graph_, name, shape, values, OnnxType::kInt64);
  return name;
}

std::string OnnxGraph::Node(const char* op, const std::string& output, const std::vector<std::string>& inputs,
                            const std::vector<OnnxInt>& attributes) {
  pbf_writer node(graph_, field::graph::kNode);
  for (const std::string& input : inputs) node.add_string(field::node::kInput, input);
  node.add_string(field::node::kOutput, output);
  node.add_string(field::node::kName, output);
  node.add_string(field::node::kOpType, op);
  for (const OnnxInt& attribute : attributes) {
    pbf_writer entry(node, field::node::kAttribute);
    entry.add_string(field::attribute::kName, attribute.name);
    entry.add_int64(field::attribute::kInt, attribute.value);
    entry.add_int32(field::attribute::kType, field::attribute::kIntType);
  }
  return output;
}

void OnnxGraph::Interface(bool is_input, const std::string& name, int width, OnnxType type) {
  pbf_writer info(graph_, is_input ? field::graph::kInput : field::graph::kOutput);
  info.add_string(1, name);
  pbf_writer type_writer(info, 2);
  pbf_writer tensor(type_writer, 1);
  tensor.add_int32(1, static_cast<int>(type));
  pbf_writer shape(tensor, 2);
  pbf_writer(shape, 1).add_string(2, "batch");
  pbf_writer(shape, 1).add_int64(1, width);
}

void OnnxGraph::Name(const std::string& name) { graph_.add_string(field::graph::kName, name); }

std::string OnnxModel(const std::string& graph, const OnnxMetadata& metadata) {
  std::string bytes;
  pbf_writer model(bytes);
  model.add_int64(field::model::kIrVersion, kOnnxIrVersion);
  model.add_string(field::model::kProducerName, "oted");
  model.add_string(field::model::kProducerVersion, OTED_VERSION);
  model.add_message(field::model::kGraph, graph);
  pbf_writer(model, field::model::kOpsetImport).add_int64(2, kOnnxOpset);
  for (const auto& [key, value] : metadata) {
    pbf_writer entry(model, field::model::kMetadata);
    entry.add_string(1, key);
    entry.add_string(2, value);
  }
  return bytes;
}

}  // namespace oted
