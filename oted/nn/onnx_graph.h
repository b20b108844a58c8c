#pragma once
/// Writes ONNX models: nodes and constants of a graph, and the model around it.

#include <map>
#include <protozero/pbf_writer.hpp>
#include <span>
#include <string>
#include <vector>

namespace oted {

/// The model's metadata_props: names and texts, in the order of the names.
using OnnxMetadata = std::map<std::string, std::string>;

inline constexpr int kOnnxOpset = 13;     ///< since ONNX 1.8
inline constexpr int kOnnxIrVersion = 7;  ///< of the same release

enum class OnnxType { kFloat = 1, kInt64 = 7 };  ///< TensorProto.DataType

/// A whole-number attribute of a node.
struct OnnxInt {
  const char* name;
  int64_t value;
};

/// Collects the nodes and constants of a graph in which each value has one name.
class OnnxGraph {
 public:
  /// Constants of the given shape; an empty shape is a scalar. @return `name`
  std::string Constant(const std::string& name, const std::vector<int64_t>& shape, std::span<const float> values);
  std::string Constant(const std::string& name, const std::vector<int64_t>& shape, std::span<const int64_t> values);
  std::string Vector(const std::string& name, const std::vector<float>& values) {
    return Constant(name, {static_cast<int64_t>(values.size())}, values);
  }
  std::string Vector(const std::string& name, const std::vector<int64_t>& values) {
    return Constant(name, {static_cast<int64_t>(values.size())}, values);
  }
  /// A node with one output, which has the node's name. @return that name
  std::string Node(const char* op, const std::string& output, const std::vector<std::string>& inputs,
                   const std::vector<OnnxInt>& attributes = {});
  /// A (batch, width) input or output.
  void Interface(bool is_input, const std::string& name, int width, OnnxType type = OnnxType::kFloat);
  void Name(const std::string& name);
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  protozero::pbf_writer graph_{bytes_};
};

/// The bytes of a model with one graph.
std::string OnnxModel(const std::string& graph, const OnnxMetadata& metadata);

}  // namespace oted
