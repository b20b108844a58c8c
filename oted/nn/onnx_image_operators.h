#pragma once
/// The ONNX operators that take images: rows of a batch as (channels, height, width).

#include "oted/nn/onnx_call.h"

namespace oted {

/// Convolution in two dimensions, of all channels, with strides and padding. @throws DataError, without the file's name
OnnxValue OnnxConv(const onnx::Call& call);
/// The mean of each channel, an image of one place. @throws DataError
OnnxValue OnnxGlobalAveragePool(const onnx::Call& call);

}  // namespace oted
