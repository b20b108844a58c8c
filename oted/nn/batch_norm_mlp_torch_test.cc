#include <gtest/gtest.h>

#include "oted/nn/torch_testing.h"

namespace oted::batch_norm_mlp_torch_test {

struct Shape {
  int in;
  std::vector<int> hidden;
  int out, batch;
};

const std::vector<Shape>& Shapes() {
  static const std::vector<Shape> shapes = {
      {5, {}, 3, 7}, {5, {}, 1, 9}, {11, {64}, 6, 33}, {14, {256, 256}, 1, 512}, {17, {256, 300}, 12, 256}};
  return shapes;
}

/// Neither scales, shifts nor running statistics at their start.
BatchNormMlp MakeNet(const Shape& s) {
  BatchNormMlp net(s.in, s.hidden, s.out);
  Rng rng(1);
  net.Initialize(rng);
  for (size_t l = 0; l < net.layers().size(); ++l) {
    for (size_t j = 0; j < static_cast<size_t>(net.layers()[l].in); ++j) {
      net.parameters()[net.gamma(l) + j] = static_cast<float>(rng.Uniform(0.5, 1.5));
      net.parameters()[net.beta(l) + j] = static_cast<float>(rng.Uniform(-0.5, 0.5));
      net.running()[net.running_mean(l) + j] = static_cast<float>(rng.Uniform(-0.5, 1.5));
      net.running()[net.running_variance(l) + j] = static_cast<float>(rng.Uniform(0.02, 2));
    }
  }
  return net;
}

// Relative to the largest number: single precision sums of at most 512 terms.
constexpr double kRelative = 2e-5;

void CompareOnABatch(bool renormalise) {
  for (const Shape& s : Shapes()) {
    SCOPED_TRACE(testing::Message() << s.in << " -> " << s.hidden.size() << " hidden -> " << s.out);
    BatchNormMlp net = MakeNet(s);
    AutogradBatchNormMlp reference(net);
    const auto x = Normals(static_cast<size_t>(s.batch * s.in), 2, 0.7f, 0.4f);
    const auto dy = Normals(static_cast<size_t>(s.batch * s.out), 3);
    const torch::Tensor ty = reference.Train(ToTensor(x, s.batch, s.in), 0.1, renormalise);
    (ty * ToTensor(dy, s.batch, s.out)).sum().backward();

    BatchNormPass pass;
    const float* y = pass.Forward(net, x.data(), s.batch, 0.1f, renormalise);
    const torch::Tensor forward = ToTensor({y, static_cast<size_t>(s.batch * s.out)}, s.batch, s.out);
    EXPECT_LT((forward - ty).abs().max().item<double>(), kRelative * ty.abs().max().item<double>());
    EXPECT_LT(MaxDifference(net.running(), Flattened({reference.running})),
              kRelative * Largest(Flattened({reference.running})));

    std::vector<float> gradient(net.n_parameters(), NAN);
    pass.Backward(net, x.data(), dy.data(), s.batch, gradient.data());
    EXPECT_LT(MaxDifference(gradient, Flattened(reference.parameters, true)),
              kRelative * Largest(Flattened(reference.parameters, true)));
  }
}

TEST(BatchNormMlpAgainstAutograd, ByTheBatchsStatisticsOutputsGradientsAndRunningStatisticsAgree) {
  CompareOnABatch(false);
}

TEST(BatchNormMlpAgainstAutograd, RenormalisedToTheRunningStatisticsTheyAgreeToo) { CompareOnABatch(true); }

TEST(BatchNormMlpAgainstAutograd, FoldedItIsTheSameFunctionAsWithTheRunningStatistics) {
  for (const Shape& s : Shapes()) {
    const BatchNormMlp net = MakeNet(s);
    const auto x = Normals(static_cast<size_t>(s.batch * s.in), 4, 0.7f, 0.4f);
    const torch::Tensor ty = AutogradBatchNormMlp(net).Evaluate(ToTensor(x, s.batch, s.in));
    Mlp folded(s.in, s.hidden, s.out);
    net.FoldInto(folded);
    MlpPass pass;
    const float* y = pass.Forward(folded, x.data(), s.batch);
    const torch::Tensor forward = ToTensor({y, static_cast<size_t>(s.batch * s.out)}, s.batch, s.out);
    EXPECT_LT((forward - ty).abs().max().item<double>(), kRelative * ty.abs().max().item<double>());
  }
}

TEST(BatchNormMlp, ShiftAndScaleOfAnInputColumnDoNotMatter) {
  // On the batch's statistics, up to the epsilon beside the variance: what makes units of sensors irrelevant.
  const Shape s{6, {32}, 2, 64};
  BatchNormMlp net = MakeNet(s);
  auto x = Normals(static_cast<size_t>(s.batch * s.in), 5);
  BatchNormPass pass;
  const float* y = pass.Forward(net, x.data(), s.batch, 0.1f, false);
  const std::vector<float> before(y, y + s.batch * s.out);
  for (size_t i = 0; i < x.size(); i += static_cast<size_t>(s.in)) x[i + 2] = 40 + 25 * x[i + 2];
  y = pass.Forward(net, x.data(), s.batch, 0.1f, false);
  EXPECT_LT(MaxDifference(before, std::vector<float>(y, y + s.batch * s.out)), 5e-3);
}

}  // namespace oted::batch_norm_mlp_torch_test
