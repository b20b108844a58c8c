#include "oted/nn/feature_net.h"

#include <algorithm>
#include <cmath>

#include "oted/base/error.h"
#include "oted/nn/npz_fields.h"

namespace oted {

FeatureNet::FeatureNet(const Array2<double>& rows, const InputShape& shape, const NetSize& size, int out, float bound)
    : FeatureNet(Encoder(rows, shape), size, out, bound) {}

FeatureNet::FeatureNet(Encoder encoder, const NetSize& size, int out, float bound)
    : encoder_(std::move(encoder)), bound_(bound) {
  if (!encoder_.has_image()) {
    net_ = Mlp(encoder_.n_extra(), size.hidden, out);
    return;
  }
  net_ = ConvNet({.height = encoder_.height(),
                  .width = encoder_.width(),
                  .channels = encoder_.channels(),
                  .filters = size.filters,
                  .mean_pool = size.mean_pool,
                  .n_extra = encoder_.n_extra(),
                  .hidden = size.hidden,
                  .out = out});
}

void FeatureNet::Initialize(Rng& rng) {
  std::visit([&](auto& net) { net.Initialize(rng); }, net_);
}

int FeatureNet::out() const {
  const auto* conv = std::get_if<ConvNet>(&net_);
  return conv != nullptr ? conv->shape().out : std::get<Mlp>(net_).out();
}

const std::vector<Mlp::Layer>& FeatureNet::layers() const {
  return std::visit([](const auto& net) -> const std::vector<Mlp::Layer>& { return net.layers(); }, net_);
}

AlignedVector<float>& FeatureNet::parameters() {
  return std::visit([](auto& net) -> AlignedVector<float>& { return net.parameters(); }, net_);
}

const AlignedVector<float>& FeatureNet::parameters() const {
  return std::visit([](const auto& net) -> const AlignedVector<float>& { return net.parameters(); }, net_);
}

NetSize FeatureNet::size() const {
  if (const auto* conv = std::get_if<ConvNet>(&net_)) {
    return {conv->shape().hidden, conv->shape().filters, conv->shape().mean_pool};
  }
  return {std::get<Mlp>(net_).hidden(), {}, false};
}

void FeatureNet::Save(const std::string& prefix, NpzArrays& arrays) const {
  const auto whole = [](const std::vector<int>& values) {
    return NpyArray(std::vector<int64_t>(values.begin(), values.end()));
  };
  const NetSize shape = size();
  arrays[prefix + "/parameters"] = NpyArray(std::vector<float>(parameters().begin(), parameters().end()));
  arrays[prefix + "/hidden"] = whole(shape.hidden);
  arrays[prefix + "/filters"] = whole(shape.filters);
  arrays[prefix + "/mean_pool"] = whole({shape.mean_pool ? 1 : 0});
  arrays[prefix + "/out"] = whole({out()});
  if (bound_ > 0) arrays[prefix + "/bound"] = NpyArray(std::vector<float>{bound_});
  encoder_.Save(prefix + "/input", arrays);
}

FeatureNet FeatureNet::FromArrays(const std::string& prefix, const NpzArrays& arrays, const std::string& where) {
  const NpzFields fields{prefix, arrays, where};
  const auto widths = [&](const std::string& name) {
    std::vector<int> list;
    for (const double width : fields.Get(name)) {
      if (!(width >= 1 && width <= 65536 && width == std::floor(width)) || list.size() == 32) fields.Fail(name);
      list.push_back(static_cast<int>(width));
    }
    return list;
  };
  const std::vector<int> out = widths("out");
  if (out.size() != 1) fields.Fail("out");
  const std::vector<double> mean_pool = fields.Get("mean_pool"), parameters = fields.Get("parameters");
  if (mean_pool.size() != 1 || (mean_pool[0] != 0 && mean_pool[0] != 1)) fields.Fail("mean_pool");
  std::vector<double> bound = {0};
  if (fields.Find("bound") != nullptr) bound = fields.Get("bound");
  if (bound.size() != 1 || !(bound[0] >= 0 && bound[0] <= 1e6)) fields.Fail("bound");
  const NetSize size{widths("hidden"), widths("filters"), mean_pool[0] == 1};
  Encoder encoder = Encoder::Load(prefix + "/input", arrays, where);
  double count = 0, in = encoder.n_extra();
  if (encoder.has_image()) {
    double channels = encoder.channels();
    for (const int filters : size.filters) {
      count += (9 * channels + 1) * filters;
      channels = filters;
    }
    const double shrunk = 2.0 * static_cast<double>(size.filters.size());
    const double height = encoder.height() - shrunk, width = encoder.width() - shrunk;
    if (height < 1 || width < 1) fields.Fail("filters");
    in += channels * (size.mean_pool ? 1 : height * width);
  }
  for (const int width : size.hidden) {
    count += (in + 1) * width;
    in = width;
  }
  count += (in + 1) * out[0];
  if (count != static_cast<double>(parameters.size()) ||
      !std::ranges::all_of(parameters, [](double v) { return std::isfinite(v); })) {
    fields.Fail("parameters");
  }
  FeatureNet net(std::move(encoder), size, out[0], static_cast<float>(bound[0]));
  std::ranges::transform(parameters, net.parameters().begin(), [](double v) { return static_cast<float>(v); });
  return net;
}

void FeatureNet::RestoreEncoder(Encoder encoder, const std::string& where) {
  const auto image = [](const Encoder& e) { return e.has_image() ? e.height() * e.width() * e.channels() : 0; };
  if (encoder.in() != encoder_.in() || encoder.n_extra() != encoder_.n_extra() || image(encoder) != image(encoder_)) {
    throw DataError("the arrays of '" + where + "' were made for other features; remove it to make it again");
  }
  encoder_ = std::move(encoder);
}

void FeaturePass::Reserve(const FeatureNet& net, int n) {
  n_ = n;
  const Encoder& encoder = net.encoder();
  const size_t rows = static_cast<size_t>(n);
  if (encoder.has_image()) {
    images_.resize(rows * static_cast<size_t>(encoder.height() * encoder.width() * encoder.channels()));
  }
  extra_.resize(rows * static_cast<size_t>(encoder.n_extra()));
}

void FeaturePass::Encode(const FeatureNet& net, std::span<const double> row, int at) {
  OTED_CHECK(static_cast<int>(row.size()) == net.in() && at < n_);
  const size_t image = images_.size() / static_cast<size_t>(n_), extra = extra_.size() / static_cast<size_t>(n_);
  const size_t i = static_cast<size_t>(at);
  net.encoder().Encode(row, net.bound_, {images_.data() + i * image, image}, {extra_.data() + i * extra, extra});
}

void FeaturePass::Encode(const FeatureNet& net, const Array2<double>& rows, int first) {
  for (int i = 0; i < rows.rows(); ++i) Encode(net, rows.row(i), first + i);
}

const float* FeaturePass::Forward(const FeatureNet& net) {
  if (const auto* conv = std::get_if<ConvNet>(&net.net_)) {
    return conv_.Forward(*conv, images_.data(), extra_.empty() ? nullptr : extra_.data(), n_);
  }
  return mlp_.Forward(std::get<Mlp>(net.net_), extra_.data(), n_);
}

void FeaturePass::Backward(const FeatureNet& net, const float* dy, float* gradient) {
  if (const auto* conv = std::get_if<ConvNet>(&net.net_)) {
    conv_.Backward(*conv, dy, n_, gradient);
  } else {
    mlp_.Backward(std::get<Mlp>(net.net_), extra_.data(), dy, n_, {.parameters = gradient});
  }
}

}  // namespace oted
