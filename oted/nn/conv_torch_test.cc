#include <gtest/gtest.h>

#include "oted/base/error.h"
#include "oted/nn/categorical.h"
#include "oted/nn/conv.h"
#include "oted/nn/torch_testing.h"

namespace oted::conv_torch_test {

// The same network in libtorch, in double precision, on leaves in the order of the flat vector.
struct TorchConv {
  std::vector<torch::Tensor> parameters;

  explicit TorchConv(const ConvNet& net) {
    const float* p = net.parameters().data();
    for (const Mlp::Layer& layer : net.layers()) {
      const size_t in = static_cast<size_t>(layer.in), out = static_cast<size_t>(layer.out);
      parameters.push_back(ToTensor({p + layer.weight, in * out}, layer.in, layer.out).requires_grad_());
      parameters.push_back(ToTensor({p + layer.bias, out}, 1, layer.out).requires_grad_());
    }
  }

  torch::Tensor Forward(const ConvNet& net, const torch::Tensor& images, const torch::Tensor& extra) const {
    torch::Tensor x = images.permute({0, 3, 1, 2});
    size_t i = 0;
    for (int l = 0; l < net.n_convolutions(); ++l, i += 2) {
      const torch::Tensor weight = parameters[i].reshape({3, 3, net.channels(l), -1}).permute({3, 2, 0, 1});
      x = torch::relu(torch::conv2d(x, weight, parameters[i + 1].reshape({-1})));
    }
    x = net.shape().mean_pool ? x.mean(std::vector<int64_t>{2, 3}) : x.permute({0, 2, 3, 1}).flatten(1);
    if (net.shape().n_extra > 0) x = torch::cat({x, extra}, 1);
    for (; i < parameters.size(); i += 2) {
      x = x.matmul(parameters[i]) + parameters[i + 1];
      if (i + 2 < parameters.size()) x = torch::relu(x);
    }
    return x;
  }

  std::vector<double> Gradient() const { return Flattened(parameters, true); }
};

TEST(ConvAgainstAutograd, OutputAndParameterGradientAgree) {
  constexpr double kRelative = 2e-5;
  for (const ConvShape& shape :
       {ConvShape{7, 7, 20, {16, 32}, false, 7, {64}, 3}, ConvShape{7, 7, 20, {16, 32, 32}, true, 0, {}, 1},
        ConvShape{10, 8, 3, {5, 4}, true, 4, {16, 8}, 2}, ConvShape{3, 3, 2, {6}, false, 0, {5}, 4},
        ConvShape{4, 5, 3, {}, false, 2, {9}, 2}}) {
    ConvNet net(shape);
    Rng rng(1);
    net.Initialize(rng);
    // The second batch is smaller and reuses the memory of the first.
    ConvPass pass;
    for (const int batch : {33, 5}) {
      SCOPED_TRACE(testing::Message() << shape.filters.size() << " convolutions, batch " << batch);
      const auto images = Normals(static_cast<size_t>(batch * net.image_size()), 2);
      const auto extra = Normals(static_cast<size_t>(batch * shape.n_extra), 3);
      const auto dy = Normals(static_cast<size_t>(batch * shape.out), 4);
      const TorchConv reference(net);
      const torch::Tensor y = reference.Forward(
          net, ToTensor(images, batch, net.image_size()).reshape({batch, shape.height, shape.width, shape.channels}),
          ToTensor(extra, batch, shape.n_extra));
      (y * ToTensor(dy, batch, shape.out)).sum().backward();
      const std::vector<double> expected = reference.Gradient();

      const float* ours = pass.Forward(net, images.data(), extra.data(), batch);
      const torch::Tensor got = ToTensor({ours, static_cast<size_t>(batch * shape.out)}, batch, shape.out);
      EXPECT_LT((got - y).abs().max().item<double>(), kRelative * y.abs().max().item<double>());
      std::vector<float> gradient(net.n_parameters(), NAN);
      pass.Backward(net, dy.data(), batch, gradient.data());
      EXPECT_LT(MaxDifference(gradient, expected), kRelative * Largest(expected));
    }
  }
}

TEST(ConvNet, TooManyConvolutionsAreAnError) {
  ConvShape shape;
  shape.filters = {4, 4, 4, 4};
  EXPECT_THROW(ConvNet{shape}, UsageError);
}

TEST(CategoricalAgainstAutograd, LossAndGradientAgree) {
  const int rows = 17, n = 5;
  const auto logits = Normals(rows * n, 5);
  std::vector<int> actions;
  std::vector<int64_t> targets;
  Rng rng(6);
  for (int i = 0; i < rows; ++i) {
    actions.push_back(static_cast<int>(rng.Below(n)));
    targets.push_back(actions.back());
  }
  const torch::Tensor leaf = ToTensor(logits, rows, n).requires_grad_();
  const torch::Tensor loss = torch::nll_loss(torch::log_softmax(leaf, 1), torch::tensor(targets, torch::kInt64));
  loss.backward();
  std::vector<float> gradient(logits.size());
  EXPECT_NEAR(CategoricalLoss(logits, n, actions, gradient), loss.item<double>(), 1e-6);
  const torch::Tensor wanted = leaf.grad().contiguous();
  EXPECT_LT(MaxDifference(gradient, std::span<const double>(wanted.data_ptr<double>(), logits.size())), 1e-7);
}

TEST(Categorical, SamplesHaveTheProbabilitiesAndLargeLogitsDoNotOverflow) {
  const std::vector<float> logits = {1000.0f, 1000.0f + std::log(3.0f), -1000.0f};
  std::vector<float> log_p(3);
  LogSoftmax(logits, 3, log_p);
  EXPECT_NEAR(log_p[1], std::log(0.75), 1e-4);
  Rng rng(7);
  int counts[3] = {};
  for (int i = 0; i < 10000; ++i) ++counts[SampleCategorical(logits, rng)];
  EXPECT_NEAR(counts[1], 7500, 4 * std::sqrt(10000 * 0.75 * 0.25));
  EXPECT_EQ(counts[2], 0);
  EXPECT_EQ(MostProbable(logits), 1);
}

}  // namespace oted::conv_torch_test
