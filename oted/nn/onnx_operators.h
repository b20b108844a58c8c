#pragma once
/// The ONNX operators that policies are made of, on batches of rows.

#include <span>
#include <string>
#include <vector>

#include "oted/base/array2.h"
#include "oted/nn/onnx_file.h"

namespace oted {

/// What flows along an edge: one row for each observation of the batch, or a constant.
struct OnnxValue {
  bool is_batch = false;
  std::vector<int> image;     ///< (channels, height, width) of each row where it is an image or a filter; else empty
  int rows = 1, cols = 1;     ///< a constant's: (1, 1) for a scalar, (1, k) for a vector
  AlignedVector<float> data;  ///< (rows, cols); empty for an integer constant
  std::vector<int64_t> integers;
};

/// A constant of at most two dimensions, or of the four of a convolution's weight, as a value. @throws DataError,
/// without the file's name
OnnxValue ConstantValue(const OnnxTensor& tensor);

/// The operators that ApplyOnnx knows, in alphabetical order.
std::vector<std::string> OnnxOperators();

/// One node. `inputs` are its node's, null for one that is left out; one value for each of the node's outputs.
/// @throws DataError, without the file's name, when the operator does not take such inputs or attributes.
std::vector<OnnxValue> ApplyOnnx(const OnnxNode& node, std::span<const OnnxValue* const> inputs);

}  // namespace oted
