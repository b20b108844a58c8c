#include <gtest/gtest.h>

#include "oted/nn/layer_norm_mlp.h"
#include "oted/nn/torch_testing.h"

namespace oted::layer_norm_mlp_torch_test {

TEST(LayerNormMlpAgainstAutograd, OutputAndAllGradientsAgreeAtAnyShape) {
  struct Shape {
    int in;
    std::vector<int> hidden;
    int out, batch;
  };
  for (const Shape& s :
       {Shape{5, {}, 3, 7}, Shape{11, {64}, 6, 33}, Shape{6, {7, 19}, 1, 9}, Shape{14, {256, 256, 256}, 1, 128}}) {
    SCOPED_TRACE(s.in);
    LayerNormMlp net(s.in, s.hidden, s.out);
    Rng rng(1);
    net.Initialize(rng);
    for (size_t l = 0; l < s.hidden.size(); ++l) {
      for (size_t j = 0; j < 2 * static_cast<size_t>(s.hidden[l]); ++j) {
        net.parameters()[net.gamma(l) + j] += static_cast<float>(rng.Uniform(-0.5, 0.5));
      }
    }
    AutogradLayerNormMlp reference(net);
    const auto x = Normals(static_cast<size_t>(s.batch * s.in), 2);
    const auto dy = Normals(static_cast<size_t>(s.batch * s.out), 3);
    const torch::Tensor tx = ToTensor(x, s.batch, s.in).requires_grad_();
    const torch::Tensor ty = reference.Forward(tx);
    (ty * ToTensor(dy, s.batch, s.out)).sum().backward();

    LayerNormPass pass;
    const float* y = pass.Forward(net, x.data(), s.batch);
    const torch::Tensor own = ToTensor({y, static_cast<size_t>(s.batch * s.out)}, s.batch, s.out);
    EXPECT_LT((own - ty).abs().max().item<double>(), 1e-5 * ty.abs().max().item<double>());
    std::vector<float> gradient(net.n_parameters(), NAN), dx(static_cast<size_t>(s.batch * (s.in - 2)), NAN);
    pass.Backward(net, x.data(), dy.data(), s.batch, {gradient.data(), dx.data(), {2, s.in}});
    const std::vector<double> expected = Flattened(reference.parameters, true);
    EXPECT_LT(MaxDifference(gradient, expected), 1e-5 * Largest(expected));
    const std::vector<double> expected_dx = Flattened({tx.grad().slice(1, 2, s.in)});
    EXPECT_LT(MaxDifference(dx, expected_dx), 1e-5 * Largest(expected_dx));
    // The input's gradient alone is the same.
    pass.Forward(net, x.data(), s.batch);
    std::vector<float> alone(dx.size(), NAN);
    pass.Backward(net, x.data(), dy.data(), s.batch, {.x = alone.data(), .columns = {2, s.in}});
    EXPECT_EQ(alone, dx);
  }
}

}  // namespace oted::layer_norm_mlp_torch_test
