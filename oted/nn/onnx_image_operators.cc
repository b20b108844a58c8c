#include "oted/nn/onnx_image_operators.h"

#include "oted/nn/gemm.h"

namespace oted {

using onnx::Call, onnx::Fail, onnx::Shaped, onnx::kMaxConstant, onnx::kMaxWidth;

namespace {

const OnnxValue& Image(const Call& call) {
  if (call.Batch(0).image.empty()) Fail("takes images as input 1");
  return call.Batch(0);
}

/// How a convolution moves over one axis.
struct Sweep {
  int in, kernel, stride, before, out;
};

Sweep SweepOf(const Call& call, int in, int kernel, size_t axis) {
  const auto at = [&](const char* name, size_t k, size_t size, int64_t otherwise, int64_t low) {
    const auto found = call.node.attributes.find(name);
    if (found == call.node.attributes.end()) return otherwise;
    const std::vector<int64_t>& values = found->second.integers;
    if (values.size() != size || values[k] < low || values[k] > kMaxWidth) Fail(fmt::format("has {} of no use", name));
    return values[k];
  };
  if (at("dilations", axis, 2, 1, 1) != 1) Fail("with dilations is not read");
  const int64_t stride = at("strides", axis, 2, 1, 1), before = at("pads", axis, 4, 0, 0),
                after = at("pads", axis + 2, 4, 0, 0);
  const int64_t room = in + before + after - kernel;
  if (room < 0) Fail(fmt::format("with a kernel of {} over {} places", kernel, in + before + after));
  return {in, kernel, static_cast<int>(stride), static_cast<int>(before), static_cast<int>(room / stride + 1)};
}

}  // namespace

OnnxValue OnnxGlobalAveragePool(const Call& call) {
  const OnnxValue& x = Image(call);
  const int channels = x.image[0], places = x.cols / channels;
  OnnxValue y = Shaped(true, x.rows, channels);
  y.image = {channels, 1, 1};
  for (size_t i = 0; i < y.data.size(); ++i) {
    float sum = 0;
    for (int p = 0; p < places; ++p) sum += x.data[i * static_cast<size_t>(places) + static_cast<size_t>(p)];
    y.data[i] = sum / static_cast<float>(places);
  }
  return y;
}

// Each observation's patches times the filters.
OnnxValue OnnxConv(const Call& call) {
  const OnnxValue &x = Image(call), &w = call.Constant(1);
  if (w.image.empty() || w.image[0] != x.image[0] || call.Integer("group", 1) != 1) {
    Fail("is read with one group and a weight of four dimensions alone, for as many channels as its image has");
  }
  if (call.HasAttribute("auto_pad")) Fail("with auto_pad is not read");
  const Sweep down = SweepOf(call, x.image[1], w.image[1], 0), right = SweepOf(call, x.image[2], w.image[2], 1);
  const int channels = x.image[0], filters = w.rows;
  const int64_t n_places = int64_t{down.out} * right.out;
  if (n_places * w.cols > kMaxConstant || n_places * filters > kMaxWidth) Fail("makes an image too large for a policy");
  const int places = static_cast<int>(n_places);
  OnnxValue y = Shaped(true, x.rows, filters * places);
  y.image = {filters, down.out, right.out};
  AlignedVector<float> patches(static_cast<size_t>(places) * static_cast<size_t>(w.cols));
  for (int i = 0; i < x.rows; ++i) {
    const float* image = x.data.data() + static_cast<size_t>(i) * static_cast<size_t>(x.cols);
    float* to = patches.data();
    for (int p = 0; p < places; ++p) {
      const int top = p / right.out * down.stride - down.before, left = p % right.out * right.stride - right.before;
      for (int c = 0; c < channels; ++c) {
        for (int dy = 0; dy < down.kernel; ++dy) {
          for (int dx = 0; dx < right.kernel; ++dx) {
            const int row = top + dy, col = left + dx;
            const bool inside = row >= 0 && row < down.in && col >= 0 && col < right.in;
            *to++ = inside ? image[(c * down.in + row) * right.in + col] : 0.0f;
          }
        }
      }
    }
    float* out = y.data.data() + static_cast<size_t>(i) * static_cast<size_t>(y.cols);
    Gemm(Op::kNone, Op::kTranspose, filters, places, w.cols, w.data.data(), w.cols, patches.data(), w.cols, 0, out,
         places);
  }
  if (!call.Has(2)) return y;
  const OnnxValue& bias = call.Constant(2);
  if (bias.cols != filters || bias.rows != 1 || !bias.image.empty())
    Fail(fmt::format("takes {} numbers as bias", filters));
  for (size_t i = 0; i < y.data.size(); ++i) {
    y.data[i] += bias.data[i / static_cast<size_t>(places) % static_cast<size_t>(filters)];
  }
  return y;
}

}  // namespace oted
