#pragma once
/// Element-wise passes of the networks, fused so that each touches memory once. Compiled for AVX-512, AVX2 and the
/// baseline, chosen when the program starts.

#include <cstddef>

namespace oted::kernels {

/// While it lives, this thread's arithmetic turns denormal numbers into zero: Adam's moments of idle weights decay into
/// them, and they are a hundred times slower. The former mode returns with its end, as the physics needs it.
class FlushDenormals {
 public:
  FlushDenormals();
  ~FlushDenormals();
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  unsigned int former_mode_ = 0;
};

/// y[i, j] = max(y[i, j] + bias[j], 0).
void AddBiasRelu(float* y, const float* bias, int rows, int cols);
/// y[i, j] += bias[j].
void AddBias(float* y, const float* bias, int rows, int cols);
/// dy[i, j] = 0 where h[i, j] <= 0, the derivative of the rectifier.
void MaskByRelu(float* dy, const float* h, int rows, int cols);
/// The same, and bias_gradient[j] = sum_i dy[i, j].
void MaskByReluSumColumns(float* dy, const float* h, float* bias_gradient, int rows, int cols);
/// sums[j] = sum_i x[i, j].
void SumColumns(const float* x, float* sums, int rows, int cols);
/// target += tau (source - target).
void Polyak(float* target, const float* source, float tau, size_t n);

/// One Adam step (Kingma and Ba 2015) on n parameters; `step_size` and `inverse_sqrt_correction` carry the bias
/// corrections: p -= step_size * m / (sqrt(v) * inverse_sqrt_correction + epsilon).
struct AdamArguments {
  float beta1, beta2, step_size, inverse_sqrt_correction, epsilon, weight_decay;
};
void Adam(float* parameters, const float* gradient, float* m, float* v, size_t n, const AdamArguments& arguments);

}  // namespace oted::kernels
