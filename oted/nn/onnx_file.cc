#include "oted/nn/onnx_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <protozero/pbf_reader.hpp>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/files.h"

namespace oted {
namespace {

using protozero::pbf_reader;
using protozero::pbf_wire_type;

constexpr int64_t kMaxElements = int64_t{1} << 28;  // of one tensor; a policy has some 10^5
constexpr int kFloat = 1, kInt32 = 6, kInt64 = 7, kDouble = 11;

[[noreturn]] void Fail(const std::string& what) { throw DataError(what); }

constexpr uint32_t Bytes(uint32_t tag) { return protozero::tag_and_type(tag, pbf_wire_type::length_delimited); }
constexpr uint32_t Varint(uint32_t tag) { return protozero::tag_and_type(tag, pbf_wire_type::varint); }
constexpr uint32_t Fixed32(uint32_t tag) { return protozero::tag_and_type(tag, pbf_wire_type::fixed32); }
constexpr uint32_t Fixed64(uint32_t tag) { return protozero::tag_and_type(tag, pbf_wire_type::fixed64); }

/// The numbers of raw little-endian bytes.
template <class T>
std::vector<T> FromRaw(std::string_view raw) {
  if (raw.size() % sizeof(T) != 0) Fail(fmt::format("holds {} bytes of numbers of {} bytes", raw.size(), sizeof(T)));
  std::vector<T> values(raw.size() / sizeof(T));
  if (!raw.empty()) std::memcpy(values.data(), raw.data(), raw.size());
  return values;
}

template <class T, class Range>
void Append(std::vector<T>& values, const Range& range) {
  for (const auto value : range) values.push_back(static_cast<T>(value));
}

std::pair<std::string, std::string> ReadEntry(pbf_reader message) {
  std::pair<std::string, std::string> entry;
  while (message.next()) {
    switch (message.tag_and_type()) {
      case Bytes(1):
        entry.first = message.get_string();
        break;
      case Bytes(2):
        entry.second = message.get_string();
        break;
      default:
        message.skip();
    }
  }
  return entry;
}

class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) : folder_(path.parent_path()), bytes_(ReadFile(path)) {}

  OnnxFile Read() {
    OnnxFile file;
    bool has_graph = false;
    pbf_reader model(bytes_);
    while (model.next()) {
      switch (model.tag_and_type()) {
        case Bytes(7):
          if (has_graph) Fail("has two graphs");
          has_graph = true;
          ReadGraph(model.get_message(), file);
          break;
        case Bytes(8):
          ReadOpset(model.get_message(), file);
          break;
        case Bytes(14):
          file.metadata.insert(ReadEntry(model.get_message()));
          break;
        default:
          model.skip();
      }
    }
    if (!has_graph || file.nodes.empty()) Fail("has no graph");
    std::erase_if(file.inputs, [&](const OnnxInterface& input) { return file.initializers.contains(input.name); });
    return file;
  }

 private:
  static void ReadOpset(pbf_reader message, OnnxFile& file) {
    std::string domain;
    int64_t version = 0;
    while (message.next()) {
      switch (message.tag_and_type()) {
        case Bytes(1):
          domain = message.get_string();
          break;
        case Varint(2):
          version = message.get_int64();
          break;
        default:
          message.skip();
      }
    }
    if (domain.empty() || domain == "ai.onnx") file.opset = version;
  }

  void ReadGraph(pbf_reader graph, OnnxFile& file) {
    while (graph.next()) {
      switch (graph.tag_and_type()) {
        case Bytes(1):
          file.nodes.push_back(ReadNode(graph.get_message()));
          break;
        case Bytes(5): {
          std::string name;
          OnnxTensor tensor = ReadTensor(graph.get_message(), &name);
          file.initializers.insert_or_assign(name, std::move(tensor));
          break;
        }
        case Bytes(11):
          file.inputs.push_back(ReadInterface(graph.get_message()));
          break;
        case Bytes(12):
          file.outputs.push_back(ReadInterface(graph.get_message()));
          break;
        case Bytes(15):
          Fail("has sparse weights; save them densely");
        default:
          graph.skip();
      }
    }
  }

  OnnxNode ReadNode(pbf_reader message) {
    OnnxNode node;
    while (message.next()) {
      switch (message.tag_and_type()) {
        case Bytes(1):
          node.inputs.push_back(message.get_string());
          break;
        case Bytes(2):
          node.outputs.push_back(message.get_string());
          break;
        case Bytes(3):
          node.name = message.get_string();
          break;
        case Bytes(4):
          node.op = message.get_string();
          break;
        case Bytes(5):
          ReadAttribute(message.get_message(), node);
          break;
        case Bytes(7):
          node.domain = message.get_string();
          break;
        default:
          message.skip();
      }
    }
    return node;
  }

  void ReadAttribute(pbf_reader message, OnnxNode& node) {
    std::string name;
    OnnxAttribute attribute;
    while (message.next()) {
      switch (message.tag_and_type()) {
        case Bytes(1):
          name = message.get_string();
          break;
        case Fixed32(2):
          attribute.f = message.get_float();
          break;
        case Varint(3):
          attribute.i = message.get_int64();
          break;
        case Bytes(5):
          attribute.tensor = ReadTensor(message.get_message(), nullptr);
          break;
        case Fixed32(7):
          attribute.floats.push_back(message.get_float());
          break;
        case Bytes(7):
          Append(attribute.floats, message.get_packed_float());
          break;
        case Varint(8):
          attribute.integers.push_back(message.get_int64());
          break;
        case Bytes(8):
          Append(attribute.integers, message.get_packed_int64());
          break;
        default:
          message.skip();
      }
    }
    node.attributes.insert_or_assign(name, std::move(attribute));
  }

  OnnxTensor ReadTensor(pbf_reader message, std::string* name) {
    OnnxTensor tensor;
    std::string label, raw;
    std::vector<double> doubles;
    std::map<std::string, std::string> external;
    bool has_raw = false, is_external = false;
    int64_t type = 0;
    while (message.next()) {
      switch (message.tag_and_type()) {
        case Varint(1):
          tensor.shape.push_back(message.get_int64());
          break;
        case Bytes(1):
          Append(tensor.shape, message.get_packed_int64());
          break;
        case Varint(2):
          type = message.get_int64();
          break;
        case Fixed32(4):
          tensor.floats.push_back(message.get_float());
          break;
        case Bytes(4):
          Append(tensor.floats, message.get_packed_float());
          break;
        case Varint(5):
          tensor.integers.push_back(message.get_int32());
          break;
        case Bytes(5):
          Append(tensor.integers, message.get_packed_int32());
          break;
        case Varint(7):
          tensor.integers.push_back(message.get_int64());
          break;
        case Bytes(7):
          Append(tensor.integers, message.get_packed_int64());
          break;
        case Bytes(8):
          label = message.get_string();
          break;
        case Bytes(9):
          raw = message.get_string();
          has_raw = true;
          break;
        case Fixed64(10):
          doubles.push_back(message.get_double());
          break;
        case Bytes(10):
          Append(doubles, message.get_packed_double());
          break;
        case Bytes(13):
          external.insert(ReadEntry(message.get_message()));
          break;
        case Varint(14):
          is_external = message.get_int64() == 1;
          break;
        default:
          message.skip();
      }
    }
    if (name != nullptr) *name = label;
    int64_t n = 1;
    for (const int64_t extent : tensor.shape) {
      if (extent < 0 || (extent > 0 && n > kMaxElements / extent)) {
        Fail(fmt::format("has a tensor '{}' of an impossible shape", label));
      }
      n *= extent;
    }
    if (is_external) raw = ReadExternal(external, label);
    if (is_external || has_raw) {
      switch (type) {
        case kFloat:
          tensor.floats = FromRaw<float>(raw);
          break;
        case kDouble:
          doubles = FromRaw<double>(raw);
          break;
        case kInt64:
          tensor.integers = FromRaw<int64_t>(raw);
          break;
        case kInt32:
          tensor.integers.clear();
          Append(tensor.integers, FromRaw<int32_t>(raw));
          break;
        default:
          break;
      }
    }
    if (type == kDouble) {
      tensor.floats.clear();
      Append(tensor.floats, doubles);
    }
    tensor.is_integer = type == kInt32 || type == kInt64;
    // Of another type: an error only where the policy needs it, so hold it as an empty one.
    const bool known = tensor.is_integer || type == kFloat || type == kDouble;
    const size_t found = tensor.is_integer ? tensor.integers.size() : tensor.floats.size();
    if (known && found != static_cast<size_t>(n)) {
      Fail(fmt::format("has a tensor '{}' of {} numbers, wanted {}", label, found, n));
    }
    if (!known) tensor = {.shape = {0}, .is_integer = true, .floats = {}, .integers = {}};
    return tensor;
  }

  std::string ReadExternal(const std::map<std::string, std::string>& entries, const std::string& label) {
    const auto get = [&](const char* key) {
      const auto found = entries.find(key);
      return found == entries.end() ? std::string() : found->second;
    };
    const auto number = [&](const char* key, size_t otherwise) {
      const std::string text = get(key);
      if (text.empty()) return otherwise;
      if (text.size() > 15 || text.find_first_not_of("0123456789") != std::string::npos) {
        Fail(fmt::format("has a tensor '{}' whose external {} is no number", label, key));
      }
      return static_cast<size_t>(std::stoull(text));
    };
    const std::string location = get("location");
    if (location.empty() || location == ".." ||
        location.find_first_of(std::string_view("/\\\0", 3)) != std::string::npos) {
      Fail(fmt::format("keeps tensor '{}' in another folder; save the model as one file", label));
    }
    auto [data, is_new] = external_.try_emplace(location);
    if (is_new) data->second = ReadFile(folder_ / location);
    const size_t offset = number("offset", 0), size = data->second.size();
    const size_t length = number("length", offset <= size ? size - offset : 0);
    if (offset > size || length > size - offset) {
      Fail(fmt::format("keeps tensor '{}' beyond the end of '{}'", label, location));
    }
    return data->second.substr(offset, length);
  }

  static OnnxInterface ReadInterface(pbf_reader message) {
    OnnxInterface result;
    while (message.next()) {
      switch (message.tag_and_type()) {
        case Bytes(1):
          result.name = message.get_string();
          break;
        case Bytes(2):
          ReadType(message.get_message(), result);
          break;
        default:
          message.skip();
      }
    }
    return result;
  }

  static void ReadType(pbf_reader type, OnnxInterface& result) {
    while (type.next()) {
      if (type.tag_and_type() != Bytes(1)) {
        type.skip();
        continue;
      }
      pbf_reader tensor = type.get_message();
      while (tensor.next()) {
        switch (tensor.tag_and_type()) {
          case Varint(1):
            result.element_type = tensor.get_int32();
            break;
          case Bytes(2):
            ReadShape(tensor.get_message(), result);
            break;
          default:
            tensor.skip();
        }
      }
    }
  }

  static void ReadShape(pbf_reader shape, OnnxInterface& result) {
    while (shape.next()) {
      if (shape.tag_and_type() != Bytes(1)) {
        shape.skip();
        continue;
      }
      pbf_reader dim = shape.get_message();
      int64_t value = -1;
      while (dim.next()) {
        if (dim.tag_and_type() == Varint(1)) {
          value = dim.get_int64();
        } else {
          dim.skip();
        }
      }
      result.dims.push_back(value);
    }
  }

  std::filesystem::path folder_;
  std::string bytes_;
  std::map<std::string, std::string> external_;  // contents of files beside the model
};

}  // namespace

std::string Printable(std::string_view text) {
  std::string printable(text.substr(0, 1000));
  for (char& c : printable) c = c >= ' ' && c <= '~' ? c : '?';
  return printable;
}

OnnxFile ReadOnnx(const std::filesystem::path& path) {
  Reader reader(path);
  try {
    return reader.Read();
  } catch (const DataError& e) {
    throw DataError(fmt::format("ONNX model '{}' {}; export it again", path.string(), Printable(e.what())));
  } catch (const protozero::exception& e) {
    throw DataError(
        fmt::format("'{}' is no ONNX model, or a damaged one ({}); export it again", path.string(), e.what()));
  }
}

}  // namespace oted
