#pragma once
/// What the readers of ONNX's messages share. Include from oted/nn/onnx_*.cc alone.

#include <cstdint>
#include <filesystem>
#include <map>
#include <protozero/pbf_reader.hpp>
#include <string>
#include <utility>
#include <vector>

#include "oted/nn/onnx_file.h"

namespace oted {

// A field is read only with the wire type that it should have; any other is skipped, as protobuf's parsers do.
constexpr uint32_t BytesField(uint32_t tag) {
  return protozero::tag_and_type(tag, protozero::pbf_wire_type::length_delimited);
}
constexpr uint32_t VarintField(uint32_t tag) { return protozero::tag_and_type(tag, protozero::pbf_wire_type::varint); }
constexpr uint32_t Fixed32Field(uint32_t tag) {
  return protozero::tag_and_type(tag, protozero::pbf_wire_type::fixed32);
}
constexpr uint32_t Fixed64Field(uint32_t tag) {
  return protozero::tag_and_type(tag, protozero::pbf_wire_type::fixed64);
}

/// A DataError whose text goes on after "ONNX model '...' ".
[[noreturn]] void OnnxFail(const std::string& what);

template <class T, class Range>
void AppendOnnx(std::vector<T>& values, const Range& range) {
  for (const auto value : range) values.push_back(static_cast<T>(value));
}

/// StringStringEntryProto.
std::pair<std::string, std::string> ReadOnnxEntry(protozero::pbf_reader message);

/// Weights in files beside the model.
class OnnxExternalData {
 public:
  /// @param folder  of the model
  explicit OnnxExternalData(std::filesystem::path folder) : folder_(std::move(folder)) {}
  /// The bytes that `entries` (location, offset, length) name; `label` is the tensor's, for errors.
  std::string Read(const std::map<std::string, std::string>& entries, const std::string& label);
  /// The files that were read, sorted.
  std::vector<std::string> Names() const;

 private:
  std::filesystem::path folder_;
  std::map<std::string, std::string> files_;
  uint64_t n_packed_ = 0, n_bytes_ = 0;  ///< in files; handed out
};

/// TensorProto. @param name  gets the tensor's, unless null
OnnxTensor ReadOnnxTensor(protozero::pbf_reader message, OnnxExternalData& external, std::string* name);

/// The files beside a model that hold its weights, sorted by name. @throws DataError as ReadOnnx
std::vector<std::string> OnnxWeightFiles(const std::filesystem::path& path);

}  // namespace oted
