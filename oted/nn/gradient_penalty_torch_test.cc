#include <gtest/gtest.h>
#include <torch/csrc/autograd/autograd.h>

#include "oted/nn/gradient_penalty.h"
#include "oted/nn/torch_testing.h"

namespace oted::gradient_penalty_torch_test {

TEST(GradientPenaltyAgainstAutograd, PenaltyAndItsGradientAreThoseOfASecondBackwardPass) {
  struct Shape {
    int in;
    std::vector<int> hidden;
    int batch;
  };
  constexpr double kWeight = 10;
  for (const Shape& s : {Shape{4, {}, 5}, Shape{3, {16}, 9}, Shape{14, {256, 256}, 64}, Shape{6, {32, 7, 19}, 33}}) {
    SCOPED_TRACE(s.hidden.size());
    Mlp mlp(s.in, s.hidden, 1);
    Rng rng(1);
    mlp.Initialize(rng);
    for (float& p : mlp.parameters()) p *= 3;  // slopes on both sides of 1
    const auto x = Normals(static_cast<size_t>(s.batch * s.in), 2);

    AutogradMlp reference(mlp);
    const torch::Tensor tx = ToTensor(x, s.batch, s.in).requires_grad_();
    const torch::Tensor slope = torch::autograd::grad({reference.Forward(tx).sum()}, {tx}, {}, true, true)[0];
    const torch::Tensor penalty = (slope.norm(2, 1) - 1).pow(2).mean();
    // Zero times all parameters: those without a gradient have one of zero.
    torch::Tensor loss = kWeight * penalty;
    for (const torch::Tensor& p : reference.parameters) loss = loss + 0 * p.sum();
    loss.backward();
    std::vector<double> expected = Flattened(reference.parameters, true);
    double largest = 0;
    for (double& v : expected) {
      largest = std::max(largest, std::abs(v));
      v += 0.5;
    }

    std::vector<float> gradient(mlp.n_parameters(), 0.5f);  // it is added to
    GradientPenalty own;
    EXPECT_NEAR(own.Add(mlp, x.data(), s.batch, kWeight, gradient.data()), penalty.item<double>(),
                1e-5 * penalty.item<double>());
    EXPECT_GT(largest, 0.01);
    EXPECT_LT(MaxDifference(gradient, expected), 1e-5 * std::max(1.0, largest));
  }
}

TEST(GradientPenaltyAgainstAutograd, TheSquareOfTheSlopeInSomeColumnsIsThatOfASecondBackwardPass) {
  constexpr int kIn = 9, kBatch = 40;
  constexpr double kWeight = 0.1;
  Mlp mlp(kIn, {32, 7, 19}, 1);
  Rng rng(1);
  mlp.Initialize(rng);
  for (float& p : mlp.parameters()) p *= 3;
  const auto x = Normals(static_cast<size_t>(kBatch * kIn), 2);
  AutogradMlp reference(mlp);
  const torch::Tensor tx = ToTensor(x, kBatch, kIn).requires_grad_();
  const torch::Tensor slope = torch::autograd::grad({reference.Forward(tx).sum()}, {tx}, {}, true, true)[0];
  const torch::Tensor penalty = slope.slice(1, 6, kIn).pow(2).sum(1).mean();
  torch::Tensor loss = kWeight * penalty;
  for (const torch::Tensor& p : reference.parameters) loss = loss + 0 * p.sum();
  loss.backward();
  std::vector<double> expected = Flattened(reference.parameters, true);
  const double largest = Largest(expected);
  for (double& v : expected) v += 0.5;
  std::vector<float> gradient(mlp.n_parameters(), 0.5f);  // it is added to
  EXPECT_NEAR(GradientPenalty().AddSquare(mlp, x.data(), kBatch, {6, kIn}, kWeight, gradient.data()),
              penalty.item<double>(), 1e-5 * penalty.item<double>());
  EXPECT_GT(largest, 0.01);
  EXPECT_LT(MaxDifference(gradient, expected), 1e-5 * std::max(1.0, largest));
}

TEST(GradientPenaltyAgainstAutograd, ANetworkWithoutSlopeHasAPenaltyOfOneAndNoGradient) {
  Mlp mlp(3, {8}, 1);  // all zero
  const auto x = Normals(12, 3);
  std::vector<float> gradient(mlp.n_parameters(), 0.0f);
  EXPECT_EQ(GradientPenalty().Add(mlp, x.data(), 4, 1, gradient.data()), 1);
  for (const float v : gradient) EXPECT_EQ(v, 0);
}

}  // namespace oted::gradient_penalty_torch_test
