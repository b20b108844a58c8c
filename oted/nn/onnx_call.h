#pragma once
/// One node with its inputs, and what operators ask of them. For the files that implement operators.

#include <fmt/format.h>

#include <span>
#include <string>
#include <vector>

#include "oted/base/error.h"
#include "oted/nn/onnx_operators.h"

namespace oted::onnx {

// Far beyond any policy: what a damaged file may make us allocate.
inline constexpr int kMaxWidth = 1 << 16;
inline constexpr int64_t kMaxConstant = int64_t{1} << 26;

[[noreturn]] inline void Fail(const std::string& what) { throw DataError(what); }

/// A node with its inputs, and what operators ask of them.
struct Call {
  const OnnxNode& node;
  std::span<const OnnxValue* const> inputs;

  bool Has(size_t k) const { return k < inputs.size() && inputs[k] != nullptr; }
  const OnnxValue& Any(size_t k) const {
    if (!Has(k)) Fail(fmt::format("has no input {}", k + 1));
    return *inputs[k];
  }
  /// A value of floating-point numbers.
  const OnnxValue& Number(size_t k) const {
    if (Any(k).data.empty()) Fail(fmt::format("takes floating-point numbers as input {}", k + 1));
    return *inputs[k];
  }
  const OnnxValue& Batch(size_t k) const {
    if (!Number(k).is_batch) Fail(fmt::format("takes values that depend on the observation as input {}", k + 1));
    return *inputs[k];
  }
  const OnnxValue& Constant(size_t k) const {
    if (Number(k).is_batch) Fail(fmt::format("takes a constant as input {}", k + 1));
    return *inputs[k];
  }
  const std::vector<int64_t>& Integers(size_t k) const {
    if (Any(k).integers.empty()) Fail(fmt::format("takes constant integers as input {}", k + 1));
    return inputs[k]->integers;
  }
  bool HasAttribute(const char* name) const { return node.attributes.contains(name); }
  float Float(const char* name, float otherwise) const {
    const auto found = node.attributes.find(name);
    return found == node.attributes.end() ? otherwise : found->second.f;
  }
  int64_t Integer(const char* name, int64_t otherwise) const {
    const auto found = node.attributes.find(name);
    return found == node.attributes.end() ? otherwise : found->second.i;
  }
};

inline OnnxValue Shaped(bool is_batch, int rows, int cols) {
  if (cols > kMaxWidth) Fail(fmt::format("makes {} columns, more than {}", cols, kMaxWidth));
  if (!is_batch && int64_t{rows} * cols > kMaxConstant) Fail(fmt::format("makes a constant of ({}, {})", rows, cols));
  OnnxValue value;
  value.is_batch = is_batch;
  value.rows = rows;
  value.cols = cols;
  value.data.resize(static_cast<size_t>(rows) * static_cast<size_t>(cols));
  return value;
}

}  // namespace oted::onnx
