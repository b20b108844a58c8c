#pragma once
/// The part of the ONNX format (onnx.proto3) that describes a feed-forward network, as plain structs.

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace oted {

/// A constant. Exactly one of `floats` and `integers` holds the product of the shape in numbers; an empty shape is a
/// scalar.
struct OnnxTensor {
  std::vector<int64_t> shape;
  bool is_integer = false;
  std::vector<float> floats;  ///< float32 as stored, float64 rounded to it
  std::vector<int64_t> integers;
};

/// The fields that attributes of the operators read here can have.
struct OnnxAttribute {
  float f = 0;
  int64_t i = 0;
  OnnxTensor tensor;
  std::vector<float> floats;
  std::vector<int64_t> integers;
};

struct OnnxNode {
  std::string op, domain, name;
  std::vector<std::string> inputs, outputs;  ///< "": an optional one that is left out
  std::map<std::string, OnnxAttribute> attributes;
};

/// An input or output of the graph.
struct OnnxInterface {
  std::string name;
  int element_type = 0;       ///< TensorProto.DataType: 1 float32, 11 float64
  std::vector<int64_t> dims;  ///< -1: dynamic

  bool is_real() const { return element_type == 1 || element_type == 11; }
};

struct OnnxFile {
  int64_t opset = 0;  ///< of the standard operators
  std::map<std::string, std::string> metadata;
  std::vector<OnnxNode> nodes;
  std::map<std::string, OnnxTensor> initializers;
  std::vector<OnnxInterface> inputs, outputs;  ///< inputs without those that are initializers
};

/// Reads a model. Sizes are checked against the bytes that are there before anything is allocated. Weights in a second
/// file ("external data") are read when it lies beside the model.
/// @throws DataError naming the file and what is wrong with it.
OnnxFile ReadOnnx(const std::filesystem::path& path);

}  // namespace oted
