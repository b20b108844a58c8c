#include "oted/nn/onnx_file.h"

#include <fmt/format.h>

#include <protozero/pbf_reader.hpp>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/nn/onnx_wire.h"

namespace oted {
namespace {

using protozero::pbf_reader;

class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) : external_(path.parent_path()), bytes_(ReadFile(path)) {}

  OnnxFile Read() {
    OnnxFile file;
    bool has_graph = false;
    pbf_reader model(bytes_);
    while (model.next()) {
      switch (model.tag_and_type()) {
        case BytesField(7):
          if (has_graph) OnnxFail("has two graphs");
          has_graph = true;
          ReadGraph(model.get_message(), file);
          break;
        case BytesField(8):
          ReadOpset(model.get_message(), file);
          break;
        case BytesField(14):
          file.metadata.insert(ReadOnnxEntry(model.get_message()));
          break;
        default:
          model.skip();
      }
    }
    if (!has_graph || file.nodes.empty()) OnnxFail("has no graph");
    std::erase_if(file.inputs, [&](const OnnxInterface& input) { return file.initializers.contains(input.name); });
    return file;
  }
  std::vector<std::string> WeightFiles() const { return external_.Names(); }

 private:
  static void ReadOpset(pbf_reader message, OnnxFile& file) {
    std::string domain;
    int64_t version = 0;
    while (message.next()) {
      switch (message.tag_and_type()) {
        case BytesField(1):
          domain = message.get_string();
          break;
        case VarintField(2):
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
        case BytesField(1):
          file.nodes.push_back(ReadNode(graph.get_message()));
          break;
        case BytesField(5): {
          std::string name;
          OnnxTensor tensor = ReadOnnxTensor(graph.get_message(), external_, &name);
          file.initializers.insert_or_assign(name, std::move(tensor));
          break;
        }
        case BytesField(11):
          file.inputs.push_back(ReadInterface(graph.get_message()));
          break;
        case BytesField(12):
          file.outputs.push_back(ReadInterface(graph.get_message()));
          break;
        case BytesField(15):
          OnnxFail("has sparse weights; save them densely");
        default:
          graph.skip();
      }
    }
  }

  OnnxNode ReadNode(pbf_reader message) {
    OnnxNode node;
    while (message.next()) {
      switch (message.tag_and_type()) {
        case BytesField(1):
          node.inputs.push_back(message.get_string());
          break;
        case BytesField(2):
          node.outputs.push_back(message.get_string());
          break;
        case BytesField(3):
          node.name = message.get_string();
          break;
        case BytesField(4):
          node.op = message.get_string();
          break;
        case BytesField(5):
          ReadAttribute(message.get_message(), node);
          break;
        case BytesField(7):
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
        case BytesField(1):
          name = message.get_string();
          break;
        case Fixed32Field(2):
          attribute.f = message.get_float();
          break;
        case VarintField(3):
          attribute.i = message.get_int64();
          break;
        case BytesField(5):
          attribute.tensor = ReadOnnxTensor(message.get_message(), external_, nullptr);
          break;
        case Fixed32Field(7):
          attribute.floats.push_back(message.get_float());
          break;
        case BytesField(7):
          AppendOnnx(attribute.floats, message.get_packed_float());
          break;
        case VarintField(8):
          attribute.integers.push_back(message.get_int64());
          break;
        case BytesField(8):
          AppendOnnx(attribute.integers, message.get_packed_int64());
          break;
        default:
          message.skip();
      }
    }
    node.attributes.insert_or_assign(name, std::move(attribute));
  }

  static OnnxInterface ReadInterface(pbf_reader message) {
    OnnxInterface result;
    while (message.next()) {
      switch (message.tag_and_type()) {
        case BytesField(1):
          result.name = message.get_string();
          break;
        case BytesField(2):
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
      if (type.tag_and_type() != BytesField(1)) {
        type.skip();
        continue;
      }
      pbf_reader tensor = type.get_message();
      while (tensor.next()) {
        switch (tensor.tag_and_type()) {
          case VarintField(1):
            result.element_type = tensor.get_int32();
            break;
          case BytesField(2):
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
      if (shape.tag_and_type() != BytesField(1)) {
        shape.skip();
        continue;
      }
      pbf_reader dim = shape.get_message();
      int64_t value = -1;
      while (dim.next()) {
        if (dim.tag_and_type() == VarintField(1)) {
          value = dim.get_int64();
        } else {
          dim.skip();
        }
      }
      result.dims.push_back(value);
    }
  }

  OnnxExternalData external_;
  std::string bytes_;
};

OnnxFile ReadWith(Reader& reader, const std::filesystem::path& path) {
  try {
    return reader.Read();
  } catch (const DataError& e) {
    throw DataError(fmt::format("ONNX model '{}' {}; export it again", path.string(), e.what()));
  } catch (const protozero::exception& e) {
    throw DataError(
        fmt::format("'{}' is no ONNX model, or a damaged one ({}); export it again", path.string(), e.what()));
  }
}

}  // namespace

OnnxFile ReadOnnx(const std::filesystem::path& path) {
  Reader reader(path);
  return ReadWith(reader, path);
}

std::vector<std::string> OnnxWeightFiles(const std::filesystem::path& path) {
  Reader reader(path);
  ReadWith(reader, path);
  return reader.WeightFiles();
}

}  // namespace oted
