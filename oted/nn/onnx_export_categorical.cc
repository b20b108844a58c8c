#include "oted/nn/onnx_export_categorical.h"

#include <fmt/format.h>

namespace oted {
namespace {

/// Columns of the observation as a network's inputs: some compared with an index, some normalised.
class InputColumns {
 public:
  InputColumns(OnnxGraph& graph, const Encoder& encoder, float bound)
      : graph_(graph), encoder_(encoder), bound_(bound) {}

  /// (batch, columns.size()): 1 where column i holds the index `levels[i]`.
  std::string Indicators(const std::string& name, const std::vector<int64_t>& columns,
                         const std::vector<float>& levels) {
    // As the program: a number stands for the whole one below it.
    if (whole_.empty()) whole_ = graph_.Node("Floor", "whole", {"observation"});
    std::string x =
        graph_.Node("Gather", name + ".columns", {whole_, graph_.Vector(name + ".at", columns)}, {{"axis", 1}});
    x = graph_.Node("Equal", name + ".equal", {x, graph_.Vector(name + ".levels", levels)});
    return graph_.Node("Cast", name, {x}, {{"to", static_cast<int64_t>(OnnxType::kFloat)}});
  }

  /// (batch, columns.size()): (column - mean) / scale, cut. The mean in two float32 parts, as the doubles of the
  /// program know it.
  std::string Quantities(const std::string& name, const std::vector<int64_t>& columns) {
    std::vector<float> high, low, scale;
    for (const int64_t column : columns) {
      const auto j = static_cast<size_t>(column);
      const double mean = encoder_.normalizer().mean[j];
      high.push_back(static_cast<float>(mean));
      low.push_back(static_cast<float>(mean - static_cast<double>(high.back())));
      scale.push_back(static_cast<float>(encoder_.normalizer().scale[j]));
    }
    std::string x =
        graph_.Node("Gather", name + ".columns", {"observation", graph_.Vector(name + ".at", columns)}, {{"axis", 1}});
    x = graph_.Node("Sub", name + ".centred", {x, graph_.Vector(name + ".mean", high)});
    x = graph_.Node("Sub", name + ".centred_rest", {x, graph_.Vector(name + ".mean_rest", low)});
    x = graph_.Node("Div", name, {x, graph_.Vector(name + ".scale", scale)});
    if (bound_ <= 0) return x;
    const float lowest = -bound_;
    return graph_.Node("Clip", name + ".cut",
                       {x, graph_.Constant(name + ".lowest", {}, std::span(&lowest, 1)),
                        graph_.Constant(name + ".highest", {}, std::span(&bound_, 1))});
  }

 private:
  OnnxGraph& graph_;
  const Encoder& encoder_;
  float bound_;
  std::string whole_;
};

std::string Joined(OnnxGraph& graph, const std::string& name, const std::vector<std::string>& parts) {
  return parts.size() == 1 ? parts[0] : graph.Node("Concat", name, parts, {{"axis", 1}});
}

/// The encoded image, (batch, channels, height, width). A plane for each index with a channel of its own and for each
/// quantity; a 1x1 convolution makes the channels of all other indices of them: 1 less those planes.
std::string EncodedImage(OnnxGraph& graph, InputColumns& input, const Encoder& encoder) {
  const std::vector<int>& shape = encoder.shape().image;
  const int n_channels = shape[2], places = shape[0] * shape[1];
  const auto width = static_cast<size_t>(encoder.channels());
  std::vector<int64_t> index_at, quantity_at;
  std::vector<float> levels, bias(width);
  std::vector<std::vector<float>> index_planes, quantity_planes;  // what each adds to the encoded channels
  for (int c = 0; c < n_channels; ++c) {
    const auto add_plane = [&](std::vector<int64_t>& at) {
      for (int p = 0; p < places; ++p) at.push_back(p * n_channels + c);
      auto& planes = &at == &index_at ? index_planes : quantity_planes;
      return &planes.emplace_back(width);
    };
    const int n_levels = encoder.shape().levels[static_cast<size_t>(c)];
    const auto other = static_cast<size_t>(encoder.EncodedChannel(c, -1));
    if (n_levels == 0) {
      (*add_plane(quantity_at))[other] = 1;
      continue;
    }
    bias[other] = 1;
    for (int k = 0; k < n_levels; ++k) {
      const int own = encoder.EncodedChannel(c, k);
      if (own == static_cast<int>(other)) continue;
      std::vector<float>& plane = *add_plane(index_at);
      levels.insert(levels.end(), static_cast<size_t>(places), static_cast<float>(k));
      plane[other] = -1;
      if (own >= 0) plane[static_cast<size_t>(own)] = 1;
    }
  }
  std::vector<std::string> parts;
  if (!index_at.empty()) parts.push_back(input.Indicators("cells", index_at, levels));
  if (!quantity_at.empty()) parts.push_back(input.Quantities("pixels", quantity_at));
  const std::string flat = Joined(graph, "planes.flat", parts);
  std::vector<std::vector<float>> planes = index_planes;
  planes.insert(planes.end(), quantity_planes.begin(), quantity_planes.end());
  const auto n_planes = static_cast<int64_t>(planes.size());
  const std::string x = graph.Node(
      "Reshape", "planes",
      {flat, graph.Vector("planes.shape", std::vector<int64_t>{-1, n_planes, encoder.height(), encoder.width()})});
  std::vector<float> weight;
  for (size_t k = 0; k < width; ++k) {
    for (const std::vector<float>& plane : planes) weight.push_back(plane[k]);
  }
  return graph.Node("Conv", "encoded",
                    {x, graph.Constant("encoded.weight", {static_cast<int64_t>(width), n_planes, 1, 1}, weight),
                     graph.Vector("encoded.bias", bias)});
}

/// What joins the image, or all there is: the numbers behind it, in their order.
std::vector<std::string> Extra(InputColumns& input, const Encoder& encoder) {
  const auto& levels = encoder.shape().levels;
  const auto levels_of = [&](int j) { return levels.empty() ? 0 : levels[static_cast<size_t>(j)]; };
  std::vector<std::string> parts;
  for (int j = encoder.shape().image_size(); j < encoder.in();) {
    const std::string name = fmt::format("numbers{}", parts.size());
    const bool indices = levels_of(j) > 0;
    std::vector<int64_t> at;
    std::vector<float> compared;
    for (; j < encoder.in() && (levels_of(j) > 0) == indices; ++j) {
      if (!indices) at.push_back(j);
      for (int k = 0; k < levels_of(j); ++k) {
        at.push_back(j);
        compared.push_back(static_cast<float>(k));
      }
    }
    parts.push_back(indices ? input.Indicators(name, at, compared) : input.Quantities(name, at));
  }
  return parts;
}

std::string GraphBytes(const CategoricalPolicy& policy) {
  const FeatureNet& net = policy.net();
  const Encoder& encoder = net.encoder();
  const NetSize size = net.size();
  const float* p = net.parameters().data();
  OnnxGraph graph;
  graph.Name("policy");
  graph.Interface(true, "observation", policy.obs_dim());
  graph.Interface(false, "action", 1, OnnxType::kInt64);
  graph.Interface(false, "logits", policy.n_actions());
  InputColumns input(graph, encoder, net.bound());

  std::vector<std::string> parts;
  size_t l = 0;
  int places = 0, channels = 0;  // of the image's features where all places are kept
  if (encoder.has_image()) {
    std::string x = EncodedImage(graph, input, encoder);
    channels = encoder.channels();
    for (; l < size.filters.size(); ++l) {
      const Mlp::Layer& layer = net.layers()[l];
      // Ours is (row, column, channel) by filter, ONNX's filter by (channel, row, column).
      std::vector<float> weight;
      for (int f = 0; f < layer.out; ++f) {
        for (int c = 0; c < channels; ++c) {
          for (int cell = 0; cell < 9; ++cell) {
            weight.push_back(p[layer.weight + static_cast<size_t>((cell * channels + c) * layer.out + f)]);
          }
        }
      }
      const std::string name = fmt::format("convolution{}", l + 1);
      const std::vector<float> bias(p + layer.bias, p + layer.bias + layer.out);
      x = graph.Node("Conv", name,
                     {x, graph.Constant(name + ".weight", {layer.out, channels, 3, 3}, weight),
                      graph.Vector(name + ".bias", bias)});
      x = graph.Node("Relu", name + ".relu", {x});
      channels = layer.out;
    }
    const int lost = 2 * static_cast<int>(size.filters.size());
    places = (encoder.height() - lost) * (encoder.width() - lost);
    if (size.mean_pool) x = graph.Node("GlobalAveragePool", "pooled", {x});
    if (size.mean_pool) places = 1;
    parts.push_back(graph.Node("Flatten", "image", {x}));
  }
  for (const std::string& part : Extra(input, encoder)) parts.push_back(part);

  std::string x = Joined(graph, "features", parts);
  for (const size_t first = l; l < net.layers().size(); ++l) {
    const Mlp::Layer& layer = net.layers()[l];
    const size_t out = static_cast<size_t>(layer.out);
    std::vector<float> weight;
    for (int i = 0; i < layer.in; ++i) {
      // Ours has an image's features place by place, ONNX channel by channel.
      const int row = l == first && i < places * channels ? i % places * channels + i / places : i;
      const float* from = p + layer.weight + static_cast<size_t>(row) * out;
      weight.insert(weight.end(), from, from + out);
    }
    const bool last = l + 1 == net.layers().size();
    const std::string name = last ? "logits" : fmt::format("layer{}", l - first + 1);
    const std::vector<float> bias(p + layer.bias, p + layer.bias + out);
    x = graph.Node(
        "Gemm", name,
        {x, graph.Constant(name + ".weight", {layer.in, layer.out}, weight), graph.Vector(name + ".bias", bias)});
    if (!last) x = graph.Node("Relu", name + ".relu", {x});
  }
  graph.Node("ArgMax", "action", {x}, {{"axis", 1}, {"keepdims", 1}});
  return graph.bytes();
}

}  // namespace

std::string OnnxBytes(const CategoricalPolicy& policy, const OnnxMetadata& metadata) {
  OnnxMetadata all = metadata;
  all["n_actions"] = fmt::format("{}", policy.n_actions());
  return OnnxModel(GraphBytes(policy), all);
}

}  // namespace oted
