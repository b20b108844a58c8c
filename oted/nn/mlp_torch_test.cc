#include <gtest/gtest.h>

#include "oted/nn/mlp.h"
#include "oted/nn/torch_testing.h"

namespace oted::mlp_torch_test {

struct Shape {
  int in;
  std::vector<int> hidden;
  int out, batch;
};

// Relative to the largest number: single precision sums of at most 256 terms.
constexpr double kRelative = 1e-5;

TEST(MlpAgainstAutograd, OutputParameterGradientAndInputGradientAgree) {
  for (const Shape& s : {Shape{5, {}, 3, 7}, Shape{11, {64}, 6, 33}, Shape{17, {256, 256}, 12, 256},
                         Shape{3, {9, 31, 5}, 1, 1}, Shape{14, {256, 300}, 1, 50}}) {
    SCOPED_TRACE(testing::Message() << s.in << " -> " << s.hidden.size() << " hidden -> " << s.out);
    Mlp mlp(s.in, s.hidden, s.out);
    Rng rng(1);
    mlp.Initialize(rng);
    const auto x = Normals(static_cast<size_t>(s.batch * s.in), 2);
    const auto dy = Normals(static_cast<size_t>(s.batch * s.out), 3);

    AutogradMlp reference(mlp);
    const torch::Tensor tx = ToTensor(x, s.batch, s.in).requires_grad_();
    const torch::Tensor ty = reference.Forward(tx);
    (ty * ToTensor(dy, s.batch, s.out)).sum().backward();
    const std::vector<double> expected_gradient = Flattened(reference.parameters, true);

    MlpPass pass;
    const float* y = pass.Forward(mlp, x.data(), s.batch);
    const torch::Tensor forward = ToTensor({y, static_cast<size_t>(s.batch * s.out)}, s.batch, s.out);
    EXPECT_LT((forward - ty).abs().max().item<double>(), kRelative * ty.abs().max().item<double>());

    const InputColumns columns{s.in / 3, s.in - 1};
    const int width = columns.end - columns.begin;
    const torch::Tensor tdx = tx.grad().slice(1, columns.begin, columns.end);
    std::vector<float> gradient(mlp.n_parameters(), NAN), dx(static_cast<size_t>(s.batch * width), NAN);
    const auto expect_dx = [&] {
      const torch::Tensor got = ToTensor(dx, s.batch, width);
      EXPECT_LT((got - tdx).abs().max().item<double>(), kRelative * tdx.abs().max().item<double>());
    };
    pass.Backward(mlp, x.data(), dy.data(), s.batch, {gradient.data(), dx.data(), columns});
    EXPECT_LT(MaxDifference(gradient, expected_gradient), kRelative * Largest(expected_gradient));
    expect_dx();
    // Without the parameters' gradient other passes are used.
    dx.assign(dx.size(), NAN);
    pass.Forward(mlp, x.data(), s.batch);
    pass.Backward(mlp, x.data(), dy.data(), s.batch, {.x = dx.data(), .columns = columns});
    expect_dx();
  }
}

TEST(MlpAgainstAutograd, BackwardOnSomeRowsIsTheGradientAtThoseRows) {
  const int in = 14, batch = 40;
  for (const Shape& s : {Shape{in, {256, 256}, 1, batch}, Shape{in, {300, 33}, 2, batch}}) {
    Mlp mlp(in, s.hidden, s.out);
    Rng rng(7);
    mlp.Initialize(rng);
    const auto x = Normals(batch * in, 8);
    std::vector<int> rows;
    for (int row = 2; row < batch; row += row % 3 + 1) rows.push_back(row);
    const int n = static_cast<int>(rows.size());
    const auto dy = Normals(static_cast<size_t>(n * s.out), 9);
    AutogradMlp reference(mlp);
    const torch::Tensor tx = ToTensor(x, batch, in).requires_grad_();
    const torch::Tensor index = torch::tensor(std::vector<int64_t>(rows.begin(), rows.end()));
    (reference.Forward(tx).index_select(0, index) * ToTensor(dy, n, s.out)).sum().backward();
    const torch::Tensor expected = tx.grad().index_select(0, index).slice(1, 11, 14);
    MlpPass pass;
    pass.Forward(mlp, x.data(), batch);
    AlignedVector<float> dx(static_cast<size_t>(n * 3), NAN);
    pass.BackwardRows(mlp, rows, dy.data(), dx.data(), {11, 14});
    const double error = (ToTensor(dx, n, 3) - expected).abs().max().item<double>();
    EXPECT_LT(error, kRelative * expected.abs().max().item<double>());
  }
}

TEST(MlpAgainstAutograd, BackwardOnTheLeadingRowsIgnoresTheOthers) {
  const int in = 6, out = 2, batch = 20, leading = 9;
  Mlp mlp(in, {16, 16}, out);
  Rng rng(4);
  mlp.Initialize(rng);
  const auto x = Normals(batch * in, 5);
  const auto dy = Normals(leading * out, 6);
  AutogradMlp reference(mlp);
  const torch::Tensor ty = reference.Forward(ToTensor(x, batch, in));
  (ty.slice(0, 0, leading) * ToTensor(dy, leading, out)).sum().backward();
  MlpPass pass;
  pass.Forward(mlp, x.data(), batch);
  std::vector<float> gradient(mlp.n_parameters());
  pass.Backward(mlp, x.data(), dy.data(), leading, {.parameters = gradient.data()});
  const std::vector<double> expected = Flattened(reference.parameters, true);
  EXPECT_LT(MaxDifference(gradient, expected), kRelative * Largest(expected));
}

TEST(AdamAgainstTorch, AHundredStepsEndAtTheSameParameters) {
  for (const double weight_decay : {0.0, 0.01}) {
    const size_t n = 301;
    AlignedVector<float> parameters = Normals(n, 7);
    for (float& p : parameters) p *= 0.1f;  // the size of a network's weights
    torch::Tensor reference = ToTensor(parameters, 1, n).requires_grad_();
    Adam adam(n, {.learning_rate = 1e-3f, .weight_decay = static_cast<float>(weight_decay)});
    torch::optim::Adam torch_adam({reference}, torch::optim::AdamOptions(1e-3).weight_decay(weight_decay));
    const AlignedVector<float> start = parameters;
    for (uint64_t step = 0; step < 100; ++step) {
      AlignedVector<float> gradient = Normals(n, 100 + step);
      // Scales from 1e-4 to 1e4: Adam's step hardly depends on them.
      for (size_t i = 0; i < n; ++i)
        gradient[i] *= static_cast<float>(std::pow(10.0, static_cast<double>(i % 9) - 4.0));
      reference.mutable_grad() = ToTensor(gradient, 1, n);
      torch_adam.step();
      adam.Step({parameters.data(), n}, {gradient.data(), n});
    }
    const torch::Tensor end = reference.detach();
    const std::vector<double> expected(end.data_ptr<double>(), end.data_ptr<double>() + n);
    // Single precision: weights near 0.2 round by up to 1e-8 in each of the hundred steps.
    EXPECT_LT(MaxDifference(parameters, expected), 1e-6);
    EXPECT_GT(MaxDifference(parameters, start), 0.01);
  }
}

}  // namespace oted::mlp_torch_test
