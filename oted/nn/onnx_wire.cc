#include "oted/nn/onnx_wire.h"

#include <fmt/format.h>

#include <cstring>
#include <string_view>

#include "oted/base/error.h"
#include "oted/base/files.h"
#include "oted/data/unpack_budget.h"

namespace oted {
namespace {

using protozero::pbf_reader;

constexpr int64_t kMaxElements = int64_t{1} << 28;  // of one tensor; a policy has some 10^5
constexpr int kFloat = 1, kInt32 = 6, kInt64 = 7, kDouble = 11;

/// The numbers of raw little-endian bytes.
template <class T>
std::vector<T> FromRaw(std::string_view raw) {
  if (raw.size() % sizeof(T) != 0)
    OnnxFail(fmt::format("holds {} bytes of numbers of {} bytes", raw.size(), sizeof(T)));
  std::vector<T> values(raw.size() / sizeof(T));
  if (!raw.empty()) std::memcpy(values.data(), raw.data(), raw.size());
  return values;
}

}  // namespace

void OnnxFail(const std::string& what) { throw DataError(what); }

std::pair<std::string, std::string> ReadOnnxEntry(pbf_reader message) {
  std::pair<std::string, std::string> entry;
  while (message.next()) {
    switch (message.tag_and_type()) {
      case BytesField(1):
        entry.first = message.get_string();
        break;
      case BytesField(2):
        entry.second = message.get_string();
        break;
      default:
        message.skip();
    }
  }
  return entry;
}

std::string OnnxExternalData::Read(const std::map<std::string, std::string>& entries, const std::string& label) {
  const auto get = [&](const char* key) {
    const auto found = entries.find(key);
    return found == entries.end() ? std::string() : found->second;
  };
  const auto number = [&](const char* key, size_t otherwise) {
    const std::string text = get(key);
    if (text.empty()) return otherwise;
    if (text.size() > 15 || text.find_first_not_of("0123456789") != std::string::npos) {
      OnnxFail(fmt::format("has a tensor '{}' whose external {} is no number", label, key));
    }
    return static_cast<size_t>(std::stoull(text));
  };
  const std::string location = get("location");
  if (location.empty() || location == ".." ||
      location.find_first_of(std::string_view("/\\\0", 3)) != std::string::npos) {
    OnnxFail(fmt::format("keeps tensor '{}' in another folder; save the model as one file", label));
  }
  auto [data, is_new] = files_.try_emplace(location);
  if (is_new) data->second = ReadFile(folder_ / location);
  if (is_new) n_packed_ += data->second.size();
  const size_t offset = number("offset", 0), size = data->second.size();
  const size_t length = number("length", offset <= size ? size - offset : 0);
  if (offset > size || length > size - offset) {
    OnnxFail(fmt::format("keeps tensor '{}' beyond the end of '{}'", label, location));
  }
  // Tensors may share bytes of the file: what counts is what they become.
  n_bytes_ += length;
  if (n_bytes_ > UnpackBudget(n_packed_)) OnnxFail("keeps far more numbers than its files hold");
  return data->second.substr(offset, length);
}

std::vector<std::string> OnnxExternalData::Names() const {
  std::vector<std::string> names;
  for (const auto& [name, unused] : files_) names.push_back(name);
  return names;
}

namespace {

/// A TensorProto as it stands in the file.
struct RawTensor {
  OnnxTensor tensor;
  std::string label, raw;
  std::vector<double> doubles;
  std::map<std::string, std::string> external;
  bool has_raw = false, is_external = false;
  int64_t type = 0;
};

RawTensor ReadFields(pbf_reader message) {
  RawTensor read;
  while (message.next()) {
    switch (message.tag_and_type()) {
      case VarintField(1):
        read.tensor.shape.push_back(message.get_int64());
        break;
      case BytesField(1):
        AppendOnnx(read.tensor.shape, message.get_packed_int64());
        break;
      case VarintField(2):
        read.type = message.get_int64();
        break;
      case Fixed32Field(4):
        read.tensor.floats.push_back(message.get_float());
        break;
      case BytesField(4):
        AppendOnnx(read.tensor.floats, message.get_packed_float());
        break;
      case VarintField(5):
        read.tensor.integers.push_back(message.get_int32());
        break;
      case BytesField(5):
        AppendOnnx(read.tensor.integers, message.get_packed_int32());
        break;
      case VarintField(7):
        read.tensor.integers.push_back(message.get_int64());
        break;
      case BytesField(7):
        AppendOnnx(read.tensor.integers, message.get_packed_int64());
        break;
      case BytesField(8):
        read.label = message.get_string();
        break;
      case BytesField(9):
        read.raw = message.get_string();
        read.has_raw = true;
        break;
      case Fixed64Field(10):
        read.doubles.push_back(message.get_double());
        break;
      case BytesField(10):
        AppendOnnx(read.doubles, message.get_packed_double());
        break;
      case BytesField(13):
        read.external.insert(ReadOnnxEntry(message.get_message()));
        break;
      case VarintField(14):
        read.is_external = message.get_int64() == 1;
        break;
      default:
        message.skip();
    }
  }
  return read;
}

/// How many numbers a tensor of its shape has.
int64_t Count(const RawTensor& read) {
  int64_t n = 1;
  for (const int64_t extent : read.tensor.shape) {
    if (extent < 0 || (extent > 0 && n > kMaxElements / extent)) {
      OnnxFail(fmt::format("has a tensor '{}' of an impossible shape", read.label));
    }
    n *= extent;
  }
  return n;
}

/// Numbers that stand as bytes, of the types that are read.
void Unpack(RawTensor& read) {
  switch (read.type) {
    case kFloat:
      read.tensor.floats = FromRaw<float>(read.raw);
      break;
    case kDouble:
      read.doubles = FromRaw<double>(read.raw);
      break;
    case kInt64:
      read.tensor.integers = FromRaw<int64_t>(read.raw);
      break;
    case kInt32:
      read.tensor.integers.clear();
      AppendOnnx(read.tensor.integers, FromRaw<int32_t>(read.raw));
      break;
    default:
      break;
  }
}

}  // namespace

OnnxTensor ReadOnnxTensor(pbf_reader message, OnnxExternalData& external_data, std::string* name) {
  RawTensor read = ReadFields(std::move(message));
  if (name != nullptr) *name = read.label;
  const int64_t n = Count(read);
  if (read.is_external) read.raw = external_data.Read(read.external, read.label);
  if (read.is_external || read.has_raw) Unpack(read);
  OnnxTensor tensor = std::move(read.tensor);
  if (read.type == kDouble) {
    tensor.floats.clear();
    AppendOnnx(tensor.floats, read.doubles);
  }
  tensor.is_integer = read.type == kInt32 || read.type == kInt64;
  // Of another type: an error only where the policy needs it, so hold it as an empty one.
  const bool known = tensor.is_integer || read.type == kFloat || read.type == kDouble;
  const size_t found = tensor.is_integer ? tensor.integers.size() : tensor.floats.size();
  if (known && found != static_cast<size_t>(n)) {
    OnnxFail(fmt::format("has a tensor '{}' of {} numbers, wanted {}", read.label, found, n));
  }
  if (!known) tensor = {.shape = {0}, .is_integer = true, .floats = {}, .integers = {}};
  return tensor;
}

}  // namespace oted
