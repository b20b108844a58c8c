#include "oted/nn/conv.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "oted/base/error.h"
#include "oted/nn/gemm.h"
#include "oted/nn/kernels.h"

namespace oted {
namespace {

constexpr int kSide = 3;

size_t Size(int a, int b) { return static_cast<size_t>(a) * static_cast<size_t>(b); }

float* Room(AlignedVector<float>& values, size_t n) {
  if (values.size() < n) values.resize(n);
  return values.data();
}

// Calls visit(patch row, image row, n) for each run of kSide cells of each patch: both are contiguous there.
template <class Visit>
void ForEachRun(int batch, int height, int width, int channels, const Visit& visit) {
  const int run = kSide * channels;
  size_t patch = 0;
  for (int b = 0; b < batch; ++b) {
    for (int y = 0; y + kSide <= height; ++y) {
      for (int x = 0; x + kSide <= width; ++x) {
        for (int row = 0; row < kSide; ++row, patch += static_cast<size_t>(run)) {
          visit(patch, Size((b * height + y + row) * width + x, channels), static_cast<size_t>(run));
        }
      }
    }
  }
}

}  // namespace

ConvNet::ConvNet(const ConvShape& shape) : shape_(shape) {
  OTED_CHECK(shape.height > 0 && shape.width > 0 && shape.channels > 0 && shape.n_extra >= 0 && shape.out > 0);
  const int n = n_convolutions();
  if (height(n) < 1 || width(n) < 1) {
    throw UsageError(fmt::format("{} convolutions of 3x3 leave nothing of an image of {}x{}; use at most {}", n,
                                 shape.height, shape.width, (std::min(shape.height, shape.width) - 1) / 2));
  }
  size_t offset = 0;
  const auto add = [&](int in, int out) {
    OTED_CHECK(in > 0 && out > 0);
    layers_.push_back({in, out, offset, offset + Size(in, out)});
    offset = layers_.back().bias + static_cast<size_t>(out);
  };
  for (int l = 0; l < n; ++l) add(kSide * kSide * channels(l), shape.filters[static_cast<size_t>(l)]);
  int in = n_features() + shape.n_extra;
  for (const int width : shape.hidden) {
    add(in, width);
    in = width;
  }
  add(in, shape.out);
  parameters_.resize(offset);
}

int ConvNet::n_features() const {
  const int n = n_convolutions();
  return channels(n) * (shape_.mean_pool ? 1 : height(n) * width(n));
}

void ConvNet::Initialize(Rng& rng) {
  for (const Mlp::Layer& layer : layers_) {
    const double bound = 1.0 / std::sqrt(static_cast<double>(layer.in));
    const size_t end = layer.bias + static_cast<size_t>(layer.out);
    for (size_t i = layer.weight; i < end; ++i) parameters_[i] = static_cast<float>(rng.Uniform(-bound, bound));
  }
}

const float* ConvPass::Forward(const ConvNet& net, const float* images, const float* extra, int batch) {
  const kernels::FlushDenormals flush;
  const auto& layers = net.layers();
  const int n_convolutions = net.n_convolutions();
  inputs_.resize(layers.size());
  outputs_.resize(layers.size());
  const auto apply = [&](size_t l, int rows) {
    const Mlp::Layer& layer = layers[l];
    float* y = Room(outputs_[l], Size(rows, layer.out));
    const float* parameters = net.parameters().data();
    Gemm(Op::kNone, Op::kNone, rows, layer.out, layer.in, inputs_[l].data(), layer.in, parameters + layer.weight,
         layer.out, 0.0f, y, layer.out, {.bias = parameters + layer.bias, .rectify = l + 1 < layers.size()});
    return y;
  };

  const float* x = images;
  for (int l = 0; l < n_convolutions; ++l) {
    const int places = net.height(l + 1) * net.width(l + 1);
    const size_t at = static_cast<size_t>(l);
    float* patches = Room(inputs_[at], Size(batch * places, layers[at].in));
    ForEachRun(batch, net.height(l), net.width(l), net.channels(l), [&](size_t patch, size_t image, size_t n) {
      std::memcpy(patches + patch, x + image, n * sizeof(float));
    });
    x = apply(at, batch * places);
  }

  const size_t first = static_cast<size_t>(n_convolutions);
  const int n_features = net.n_features(), n_extra = net.shape().n_extra, row = n_features + n_extra;
  const int places = net.height(n_convolutions) * net.width(n_convolutions), channels = net.channels(n_convolutions);
  float* joined = Room(inputs_[first], Size(batch, row));
  for (int b = 0; b < batch; ++b) {
    float* to = joined + Size(b, row);
    const float* from = x + Size(b, places * channels);
    if (net.shape().mean_pool) {
      kernels::SumColumns(from, to, places, channels);
      for (int c = 0; c < channels; ++c) to[c] /= static_cast<float>(places);
    } else {
      std::memcpy(to, from, Size(1, n_features) * sizeof(float));
    }
    if (n_extra > 0) std::memcpy(to + n_features, extra + Size(b, n_extra), Size(1, n_extra) * sizeof(float));
  }
  for (size_t l = first; l < layers.size(); ++l) {
    const float* y = apply(l, batch);
    if (l + 1 == layers.size()) return y;
    std::memcpy(Room(inputs_[l + 1], Size(batch, layers[l].out)), y, Size(batch, layers[l].out) * sizeof(float));
  }
  return nullptr;  // not reached: there is always a last layer
}

void ConvPass::Backward(const ConvNet& net, const float* dy, int batch, float* parameter_gradient) {
  const kernels::FlushDenormals flush;
  const auto& layers = net.layers();
  const float* parameters = net.parameters().data();
  const size_t first = static_cast<size_t>(net.n_convolutions());
  // gradient_: at the layer's linear output. input_gradient_: at its input.
  gradient_.assign(dy, dy + Size(batch, layers.back().out));
  const auto through = [&](size_t l, int rows, bool wants_input) {
    const Mlp::Layer& layer = layers[l];
    Gemm(Op::kTranspose, Op::kNone, layer.in, layer.out, rows, inputs_[l].data(), layer.in, gradient_.data(), layer.out,
         0.0f, parameter_gradient + layer.weight, layer.out);
    kernels::SumColumns(gradient_.data(), parameter_gradient + layer.bias, rows, layer.out);
    if (!wants_input) return;
    Gemm(Op::kNone, Op::kTranspose, rows, layer.in, layer.out, gradient_.data(), layer.out, parameters + layer.weight,
         layer.out, 0.0f, Room(input_gradient_, Size(rows, layer.in)), layer.in);
  };

  for (size_t l = layers.size(); l-- > first;) {
    through(l, batch, l > 0);
    if (l == first) break;
    gradient_.assign(input_gradient_.begin(),
                     input_gradient_.begin() + static_cast<ptrdiff_t>(Size(batch, layers[l].in)));
    kernels::MaskByRelu(gradient_.data(), outputs_[l - 1].data(), batch, layers[l].in);
  }
  if (first == 0) return;

  // From the joined features back to the places of the last convolution.
  const int n = net.n_convolutions(), places = net.height(n) * net.width(n), channels = net.channels(n);
  const int row = net.n_features() + net.shape().n_extra;
  Room(gradient_, Size(batch * places, channels));
  for (int b = 0; b < batch; ++b) {
    const float* from = input_gradient_.data() + Size(b, row);
    float* to = gradient_.data() + Size(b, places * channels);
    for (int i = 0; i < places * channels; ++i) {
      to[i] = net.shape().mean_pool ? from[i % channels] / static_cast<float>(places) : from[i];
    }
  }
  for (size_t l = first; l-- > 0;) {
    const int at = static_cast<int>(l), n_places = net.height(at + 1) * net.width(at + 1);
    kernels::MaskByRelu(gradient_.data(), outputs_[l].data(), batch * n_places, layers[l].out);
    through(l, batch * n_places, l > 0);
    if (l == 0) return;
    gradient_.assign(Size(batch * net.height(at) * net.width(at), net.channels(at)), 0.0f);
    ForEachRun(batch, net.height(at), net.width(at), net.channels(at), [&](size_t patch, size_t image, size_t size) {
      for (size_t i = 0; i < size; ++i) gradient_[image + i] += input_gradient_[patch + i];
    });
  }
}

}  // namespace oted
